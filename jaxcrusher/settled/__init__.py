"""The periodic motion a crusher settles on, and slopes along it."""
