"""Tables with units, files written whole or not at all, and where results come from."""
