"""Run time against error, of this solver and others: scenes, methods, measurements, conclusions."""
