"""How an answer is told: checks, words, tables, figures and the page."""
