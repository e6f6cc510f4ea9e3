"""Whether the quiet motion survives a rough feed: predictions, and ensembles of random feeds."""
