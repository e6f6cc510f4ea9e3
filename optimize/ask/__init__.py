"""What is asked of a search: options, the machine, its free numbers, objective and limits."""
