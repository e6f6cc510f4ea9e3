"""How the answer is found: maps, descents, long runs, bounds and fronts."""
