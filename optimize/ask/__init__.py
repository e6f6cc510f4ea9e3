"""The question of a search: options, machine, free parameters, objective and limits."""
