"""What a finished run says of impact sequences that were cut short: another law ends them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from carom.result.result import Result

MOST = 0.5
"""Share of the steps with impacts: where more of them were cut, the rebounds of the run are those of another law."""
MORE = 20
"""Factor on `max_problems` in the advice; a smaller one cures fewer runs, a larger one may cost more time than it saves."""


def cut_short(result: Result) -> str | None:
    """That most steps with impacts had a sequence cut short, with what it means and a cure; None if most had none."""
    steps = result.steps
    hit = int(np.count_nonzero(np.asarray(steps["impact_problems"])))
    cut = int(np.count_nonzero(np.asarray(steps["truncated"])))
    if cut <= MOST * hit:
        return None
    now = result.scene.run.max_problems
    cure = f"raise max_problems in [run] (now {now}), for example to {MORE * now}"
    if (
        not now
    ):  # by size: the longest that came to an end says little, but a multiple of it is longer than that
        longest = int(np.max(np.asarray(steps["impact_problems"])))
        cure = f"set max_problems in [run], for example to {MORE * longest} (the longest had {longest})"
    return (
        f"impact sequences were cut short in {cut} of {hit} steps with impacts: what still closed there was one impact of"
        f" all contacts, which keeps the energy but spreads it over more balls; {cure}"
    )
