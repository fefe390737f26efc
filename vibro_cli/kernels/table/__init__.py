"""Balls on a table: event loop, walls, impacts, tangent map."""
