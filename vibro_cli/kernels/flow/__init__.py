"""Motion between events in closed form; the start of a flight."""
