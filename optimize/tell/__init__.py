"""The report of an answer: checks, words, tables, figures and the page."""
