"""The crusher written for other programs; nothing here imports jaxcrusher."""
