"""The commands, each a typed config with a `run` method; heavy imports belong inside `run`."""
