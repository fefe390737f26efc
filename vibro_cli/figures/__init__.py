"""Figures at the standard of a journal; they read tables and mechanics and never simulate."""
