"""Figures of a grid: curves and maps over its axes, basins, bifurcations."""
