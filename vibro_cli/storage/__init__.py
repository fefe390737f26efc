"""Tables with units, files that are written atomically, and the provenance of results."""
