"""The mechanics of bodies on a trace: geometry, bodies, laws of impact, motion on one piece."""
