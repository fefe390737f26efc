"""The event loop: what happens next, what it does, what is logged."""
