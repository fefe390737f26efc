"""The event loop: finding the next event, carrying it out, logging it."""
