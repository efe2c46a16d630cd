"""`rover.toml`: the model of every key, and the reader that reports every problem at once."""
