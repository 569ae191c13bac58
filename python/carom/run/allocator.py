"""What the C library does with freed memory, in runs of very many balls.

glibc keeps arrays below 32 MB that were freed, for later ones. With 10^6 balls most arrays of a step are such, and what is
kept between them was a sixth of all memory.
"""

from __future__ import annotations

import ctypes  # noqa: TID251 a setting of the C library
import sys

#: Balls from which on it matters; the core gives the memory of a step back early from 10^6 contacts on.
MANY = 300_000
#: `M_MMAP_THRESHOLD` of `mallopt(3)`, and the size (B) from which on freed arrays go back to the system at once.
_MMAP_THRESHOLD, _SIZE = -3, 1 << 20


def release_early(balls: int) -> bool:
    """Let freed arrays of this process go back to the system, if there are so many balls and the C library can do it."""
    if balls < MANY or sys.platform != "linux":
        return False
    library = ctypes.CDLL(None)
    if not (hasattr(library, "mallopt") and hasattr(library, "malloc_trim")):
        return False
    # What building the scene has left behind goes first.
    library.malloc_trim(0)
    return bool(library.mallopt(_MMAP_THRESHOLD, _SIZE))
