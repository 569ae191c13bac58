"""Scenes: their tables (`tables`), files (`toml`), calls from Python (`builders`), rules (`checks`), arrays
for the core (`assembly`); packings and the billiards kit.

`carom.Scene` is the public face of this package.
"""

from carom import _moved

__getattr__ = _moved(__name__)
