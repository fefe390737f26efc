"""Code shared by commands: options, streams, loading of scenarios, messages and errors."""
