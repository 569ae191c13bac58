"""What the tests of running and of resuming share: all that a run recorded, and a run that is interrupted."""

from __future__ import annotations

import os
import signal
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom.result.record.layout import TABLES
from carom.run.sinks import Progress


def everything(run: Path) -> dict[str, Any]:
    """All that a run recorded, as bytes, and the shapes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = carom.load(run)
    segments = result._segments
    columns = {
        f"{table}/{name}": segments.column(table, name)
        for table in TABLES
        for name in segments.columns(table)
    }
    return {name: (c.shape, np.asarray(c).tobytes()) for name, c in columns.items()}


def interrupted(scene: Any, run: Path, after: int, **options: Any) -> None:
    """Run and press Ctrl-C when step `after` is reached."""

    def press(now: Progress) -> None:
        if now.step >= after:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        carom.simulate(scene, out=run, progress=press, **options)
