"""The savings of scenes that leave things out."""
