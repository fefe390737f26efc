"""What several commands share: options, streams, reading scenarios, solving them, words."""
