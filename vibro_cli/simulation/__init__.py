"""The event loop: flights, impacts, crossings; what a run gives."""
