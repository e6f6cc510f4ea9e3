"""Springs and a counterweight that keep a crusher's block quiet, by two ways of search."""
