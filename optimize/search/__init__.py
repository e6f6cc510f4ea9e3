"""The search for the answer: maps, descents, long runs, bounds and fronts."""
