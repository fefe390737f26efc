"""Grids: many scenarios as columns, solved chunk by chunk into a dataset on the disk."""
