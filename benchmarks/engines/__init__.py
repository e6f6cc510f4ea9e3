"""What lanes do for the programs that they serve."""
