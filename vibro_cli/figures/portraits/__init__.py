"""Phase portraits: their panels, layers, limits and legend; with energies, and without a run."""
