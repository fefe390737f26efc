"""The tangent map of a motion: the growth of small changes of its start, from the flight logs."""
