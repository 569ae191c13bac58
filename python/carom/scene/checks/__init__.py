"""Rules that a scene must keep, and advice on what may not be meant."""
