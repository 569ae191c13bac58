"""Tables of text fit a terminal of 80 columns, and the first column says of what each row is."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest
from carom.text import TIE, table
from test_cli import cli

ROWS = [
    ["law", "verdict", "worst", "where"],
    ["impulse of walls", "ok", f"1.25e-10{TIE}N{TIE}s", "cue and left cushion, step 1200"],
    ["these follow, a heading over the whole line"],
    ["slip", "violated", "3", "-"],
]


@pytest.mark.parametrize("width", [160, 70, 50, 40])
def test_long_cells_wrap_and_the_first_column_does_not(width: int) -> None:
    """At 70 and 50 characters the last column wraps; at 40 it is a second block, which names its rows too."""
    text = table(ROWS, width, head=True, left=(0, 3))
    lines = text.splitlines()
    assert max(map(len, lines)) <= width
    blocks = text.count("law")
    assert blocks == (2 if width == 40 else 1)
    for first in ("impulse of walls", "slip"):
        assert len([line for line in lines if line.startswith(first)]) == blocks
    assert text.count("1.25e-10 N s") == 1
    for row in ROWS:
        for cell in row[1:]:
            assert all(word in text for word in re.split(r"[ \u00a0]", cell))


def test_what_fits_is_aligned() -> None:
    assert table([["a", "1"], ["bbb", "22", "3"]]) == "a     1\nbbb  22  3"
    assert table([]) == ""


def in_a_terminal(*arguments: str, cwd: Path, width: int = 80) -> str:
    """What `carom` prints in a terminal."""
    control, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
    command = [sys.executable, "-m", "carom", *arguments]
    process = subprocess.Popen(command, cwd=cwd, stdout=terminal, stderr=subprocess.PIPE, env=environment)
    os.close(terminal)
    seen = b""
    while True:
        try:
            part = os.read(control, 65536)
        except OSError:  # the other end is closed
            break
        seen += part
    process.communicate(timeout=60)
    os.close(control)
    return seen.decode().replace("\r\n", "\n")


def test_verdicts_and_orders_in_a_terminal_of_80_columns(tmp_path: Path) -> None:
    """The column of the laws, and that of the steps, stand as in a wide one; `-q` leaves the table."""
    cli("examples", "copy", "slide_to_roll", cwd=tmp_path)
    cli("run", "slide_to_roll.toml", "-o", "run", "--quiet", cwd=tmp_path)
    study = ("converge", "slide_to_roll.toml", "--steps", "1e-2,5e-3,2.5e-3", "--reference", "1.25e-3", "-q")
    for command, labels in (
        (("check", "run"), ["references", "penetration record", "complementarity", "wall impulse"]),
        (study, ["0.01", "0.005", "0.0025", "least squares"]),
    ):
        lines = in_a_terminal(*command, cwd=tmp_path).splitlines()
        end = next((k for k, line in enumerate(lines) if line.startswith("not judged")), len(lines))
        assert max(map(len, lines[2:end])) <= 80
        for label in labels:
            assert [line for line in lines[:end] if line.startswith(f"{label}  ")], label
    assert "order" in cli(*study, cwd=tmp_path).stdout
