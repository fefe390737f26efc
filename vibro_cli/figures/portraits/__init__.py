"""Phase portraits of runs and without a run: panels, layers, limits, legends and energies."""
