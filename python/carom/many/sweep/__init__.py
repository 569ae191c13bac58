"""Studies of many cases: `carom.sweep(study, "folder")`, `carom sweep STUDY.toml -o FOLDER`.

A `Study` says what varies, how points are chosen and where the values go in a scenario; a folder takes one row per case.
Whatever is killed, rows that were written stay, and a second call computes only what is missing.

(The package is not called `sweep`: importing it would hide the function of that name in `carom`.)
"""

from carom.many.sweep.run import Progress, sweep
from carom.many.sweep.study import Study
from carom.many.sweep.table import Sweep

__all__ = ["Progress", "Study", "Sweep", "sweep"]
