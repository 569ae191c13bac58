"""The short cases of `tools/bits.py` give the bits that are kept in the repository, or the processor is another one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parent.parent / "tools" / "bits.py"


def test_this_build_gives_the_bits_that_are_kept() -> None:
    """After a change that is meant to change results: `python tools/bits.py renew`, in a commit of its own."""
    done = subprocess.run([sys.executable, str(TOOL), "check"], capture_output=True, text=True)
    if done.returncode == 3:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
