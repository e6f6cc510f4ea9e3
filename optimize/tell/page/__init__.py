"""report.html: the page that a search leaves behind."""
