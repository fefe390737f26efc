"""Motion between events in closed form, and how a flight begins."""
