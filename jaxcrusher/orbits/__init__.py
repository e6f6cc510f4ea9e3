"""Find the periodic motion that a crusher settles on, and slopes along it."""
