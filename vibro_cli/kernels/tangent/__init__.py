"""The tangent map of a motion: how small changes of its start grow, from the logs of flights."""
