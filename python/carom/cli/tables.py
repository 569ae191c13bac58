"""Wide tables for a terminal, drawn by rich."""

from __future__ import annotations

import sys
from collections.abc import Sequence

#: Columns of a table that goes to a file or into a pipe.
PIPED_WIDTH = 160


def show_table(head: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> None:
    """Print a table: a first column of labels to the left, numbers to the right. A row of one cell is a heading."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False, width=None if sys.stdout.isatty() else PIPED_WIDTH)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for i, name in enumerate(head):
        table.add_column(Text(name), justify="left" if i == 0 else "right", no_wrap=i > 0)
    for row in rows:
        if len(row) == 1:
            table.add_section()
        table.add_row(*(Text(cell) for cell in row), style="bold" if len(row) == 1 else None)
    console.print(title, style="bold", markup=False, soft_wrap=True)
    console.print(table)
