"""Closed forms that the examples are held against; they share no code with the simulation."""
