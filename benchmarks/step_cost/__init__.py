"""The cost of a step and the number of steps: this package beside others."""
