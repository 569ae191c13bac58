"""Freed memory of runs of very many balls goes back to the system, where the C library is glibc."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest
from carom.run.allocator import MANY, release_early

#: Resident memory (B) that stays of seven freed arrays of 20 MB below one that is kept, with so many balls.
STAYS = """
import sys
import numpy as np
from carom.run.allocator import release_early

def resident():
    with open("/proc/self/statm") as file:
        return 4096 * int(file.read().split()[1])

release_early(int(sys.argv[1]))
first = np.ones(3_900_000)  # freed arrays raise the size from which on glibc asks the system
del first
before = resident()
arrays = [np.ones(2_500_000) for _ in range(8)]
arrays[:7] = []
print(resident() - before)
"""


def stays(balls: int) -> int:
    command = [sys.executable, "-c", STAYS, str(balls)]
    # Dask sets `MALLOC_TRIM_THRESHOLD_` in the process that starts workers: glibc then keeps nothing in either case.
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MALLOC_")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_few_balls_change_nothing() -> None:
    assert not release_early(MANY - 1)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_freed_arrays_go_back_with_many_balls() -> None:
    assert stays(MANY) < 40e6 < 100e6 < stays(1)
