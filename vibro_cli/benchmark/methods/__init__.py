"""The methods that are measured: this solver, integrators of other packages, the papers' series."""
