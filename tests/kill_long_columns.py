"""Writes columns of many chunks: `python kill_long_columns.py FOLDER ROWS BATCH [MAX_CHUNKS]`, to be killed meanwhile.

Rows are so made that each can be told from any other, and chunks so small that few rows need many of them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from carom.result.directory import RunDir
from carom.result.record import Writer, blank

CHUNK_ROWS = 64
BALLS = 3


def block(start: int, rows: int) -> dict[str, Any]:
    """Rows `start` and on of each table."""
    number = np.arange(start, start + rows, dtype=np.uint64)
    value = number.astype(np.float64)
    local = number - np.uint64(start) + np.uint64(1)  # ends count within a block
    return {
        "frames": {
            "step": number,
            "position": value[:, None, None] + np.arange(3 * BALLS).reshape(BALLS, 3) / 100,
            "contact_end": local,
        },
        "contacts": {"gap": value / 3, "impulse": value[:, None] * [1.0, 2.0, 3.0]},
        "steps": {"step": number},
        "impacts": {"step": number},
        "residuals": {"step": number, "end": local, "value": value / 7},
    }


def write(folder: Path, rows: int, batch: int) -> list[Path]:
    """A run of so many rows in each table, committed by batches; the files it needed."""
    directory = RunDir(folder)
    writer = Writer(
        directory.next_segment(),
        bodies={"name": ["a", "b", "c"]},
        planes={"name": []},
        attributes={"step": 1e-3, "every": 1, "gravity": np.zeros(3)},
        further=directory.next_segment,
    )
    for start in range(0, rows, batch):
        writer.append(block(start, min(batch, rows - start)))
        writer.commit()
    writer.close()
    return writer.paths


if __name__ == "__main__":
    blank.MAX_CHUNK_ROWS = CHUNK_ROWS
    if len(sys.argv) > 4:
        blank.MAX_CHUNKS = int(sys.argv[4])
    write(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
