"""Random faults put into the package and the search: whether tests of their room see them."""
