"""One value of each column is off: found by some law, or in the list of what nothing can tell (`audit_planted`)."""

from __future__ import annotations

from pathlib import Path

import audit_planted
import pytest
from trials import Trials

OWN = "sweeps are the solver's own affair"
HISTORY = "within a history, or below the largest of the step"
#: Columns in which a fault may be missed, and why; `docs/reference/audit.md` says it to users.
UNTOLD = {
    "steps/sweeps_position": OWN,
    "steps/sweeps_velocity": OWN,
    "steps/residual_smooth": HISTORY,
    "steps/residual_position": HISTORY,
    "steps/residual_velocity": HISTORY,
    "residuals/problem": HISTORY,
    "residuals/contacts": HISTORY,
    "residuals/value": HISTORY,
    "contacts/gap": "the gap of a closed contact is one of rounding: a share of it is less",
    "contacts/position_impulse": "of balls that joints hold: their position multipliers are not recorded",
}


@pytest.mark.parametrize(
    ("name", "every"),
    [
        ("break", 9),
        ("joined", 9),
        *(pytest.param(name, 1, marks=pytest.mark.long) for name in ("break", "joined")),
    ],
)
def test_one_value_that_is_off_is_found(name: str, every: int, tmp_path: Path, trials: Trials) -> None:
    run = audit_planted.made(name, tmp_path / "run")
    faults = [fault for fault in audit_planted.faults(run) if fault.column not in UNTOLD][::every]
    assert len(faults) > 100 // every
    for k, fault in enumerate(faults):
        with trials("values off by one percent, or by one, found"):
            assert not audit_planted.missed(run, tmp_path / str(k), [fault]), fault
