"""Independent judges of the solver: intervals in two doubles, Taylor series of 40 and 50 digits."""
