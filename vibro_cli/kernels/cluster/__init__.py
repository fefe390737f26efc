"""Bodies in lasting contact: their motion, their forces, which contacts hold."""
