"""The calls of a `carom.Scene` that add materials, laws, balls, walls, joints and loads."""
