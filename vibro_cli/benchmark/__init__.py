"""Run time against error, of this solver and of others: scenes, methods, measurements, words."""
