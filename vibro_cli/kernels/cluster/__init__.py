"""Bodies in lasting contact: their motion, their forces, and which contacts hold."""
