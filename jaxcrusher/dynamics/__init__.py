"""What kind of motion it is, and what a slope is worth."""
