"""Bodies on springs along a line: event loop, series, contacts, impacts, tangent map."""
