"""Closed-form analysis of the motion of one body: singular points, separatrices, level curves."""
