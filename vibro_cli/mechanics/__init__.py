"""Mechanics of bodies on a trace: geometry, potential, contacts, impact laws and initial states."""
