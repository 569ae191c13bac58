"""`python -m carom` is `carom`."""

from carom.cli import program

program()
