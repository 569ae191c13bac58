"""Scenario files: TOML to the tree of tables and back, with the line of every key."""
