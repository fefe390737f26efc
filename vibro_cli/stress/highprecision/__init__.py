"""A slow twin of the solver in 50 digits, told which events happen, and how errors grow."""
