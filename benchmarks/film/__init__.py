"""A lubricating film beside Reynolds' equation."""
