"""Stiff and extreme cases: each is judged by an independent reference, or refused."""
