"""Running extremes and totals of a run, and the columns of its table of impacts."""
