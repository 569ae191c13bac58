"""One value of each column is off: found by some law, or in the list of what nothing can tell (`audit_planted`)."""

from __future__ import annotations

from pathlib import Path

import audit_planted
import pytest
from trials import Trials

OWN = "sweeps and line searches are the solver's own affair"
HISTORY = "within a history, or below the largest of the step"
ROUNDING = "a share of a number that is itself of rounding"
COUNTS = "of `nsga` and `moreau` alone"
WEAK = "one percent of the value is less than the solver leaves"
#: Columns in which a fault may be missed, and why, and places of a column; `docs/reference/audit.md` says it to users.
UNTOLD = {
    "steps/line_search_position": OWN,
    "steps/line_search_velocity": OWN,
    "steps/sweeps_position": OWN,
    "steps/sweeps_velocity": OWN,
    "steps/residual_smooth": HISTORY,
    "steps/residual_position": HISTORY,
    "steps/residual_velocity": HISTORY,
    "residuals/problem": HISTORY,
    "residuals/contacts": HISTORY,
    "residuals/value": HISTORY,
    "break, contacts/gap": ROUNDING,
    "joined, contacts/position_impulse": "of balls that joints hold: their position multipliers are not recorded",
    "pile, contacts/gap, median": ROUNDING,
    "pile, steps/penetration, median": ROUNDING,
    "pile, steps/penetration_relative, median": ROUNDING,
    "pile, contacts/work_normal, median": WEAK,
    "pile, contacts/work_friction, median": WEAK,
    "pile, impacts/separation, median": WEAK,
    **dict.fromkeys(
        (f"events, steps/{name}" for name in ("candidates", "islands", "largest_island", "substep_min")),
        COUNTS,
    ),
    "events, frames/orientation": "where balls touch something, orientations are judged of whole steps",
    "events, transitions/mode, largest": "the first of its ball in a step, where nothing but the mode is another",
    "events, contacts/gap": "a contact may have opened within the step",
    "events, impacts/problem": "of several groups at other times any may have had the last problem",
    "residuals/end": HISTORY,
    "pile, impacts/problem, largest": "steps of a pile may count more problems than its rows are numbered by",
}
FOUND = "values off by one percent, or by one, found"


def told(name: str, fault: audit_planted.Fault) -> bool:
    """Whether a fault has to be found in a run."""
    names = (fault.column, f"{name}, {fault.column}", f"{name}, {fault.column}, {fault.place}")
    return not any(one in UNTOLD for one in names)


@pytest.mark.parametrize(
    ("name", "every", "places"),
    [
        ("break", 9, 1),
        ("joined", 9, 1),
        ("events", 9, 1),
        *(pytest.param(name, 1, 6, marks=pytest.mark.long) for name in audit_planted.RUNS),
    ],
)
def test_one_value_that_is_off_is_found(
    name: str, every: int, places: int, tmp_path: Path, trials: Trials
) -> None:
    run = audit_planted.made(name, tmp_path / "run")
    faults = [fault for fault in audit_planted.faults(run) if told(name, fault)][::every]
    assert len(faults) > 120 // every
    named = list(audit_planted.named(run, places))
    assert len(named) >= len(audit_planted.NAMED) + 2
    for what, all_of_them in ((FOUND, faults), ("faults that were missed once, found", named)):
        for k, fault in enumerate(all_of_them):
            with trials(what):
                assert not audit_planted.missed(run, tmp_path / f"{what}-{k}", [fault]), fault
