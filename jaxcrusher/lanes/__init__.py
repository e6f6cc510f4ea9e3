"""Integrations of many designs, compiled to loops over lanes; they know no model and no crusher."""
