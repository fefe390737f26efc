"""Grids: many scenarios as columns, solved in chunks into a dataset on disk."""
