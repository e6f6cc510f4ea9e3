"""What a step costs, and how many are needed: this package beside what others do."""
