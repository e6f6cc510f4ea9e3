// Browsers let no page from a disk start the worker that the search needs.
if (location.protocol === "file:") document.documentElement.classList.add("from-disk");
