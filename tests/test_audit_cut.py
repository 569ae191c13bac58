"""The auditor on impacts through springs that were cut: they go on by Newton's sequence, as one that died out does not."""

from __future__ import annotations

from pathlib import Path

import carom
import pytest
from audit_faults import kinds, reworded

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

RADIUS = 0.02


def squeezed(law: str) -> carom.Scene:
    """A ball that falls on a light one on a heavy one: springs take too many steps. Beside it three that are done."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"until": 1.3e-3, "step": 1e-4, "impact": law})
    scene.contact("m", "m", friction=0.2, restitution=0.5, tangential_restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for x, mass in ((0.0, 1e-4), (1.0, 1.0)):
        low, middle, high = ("lmh", "LMH")[int(x)]
        scene.sphere(low, radius=RADIUS, mass=1, material="m", position=(x, 0, RADIUS))
        scene.sphere(middle, radius=RADIUS, mass=mass, material="m", position=(x, 0, 3 * RADIUS))
        at = (x, 0, 5 * RADIUS + 1e-3)
        scene.sphere(high, radius=RADIUS, mass=1, material="m", position=at, velocity=(0.2, 0, -1))
    return scene


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_what_was_cut_obeys_newtons_law(law: str, tmp_path: Path) -> None:
    result = carom.simulate(squeezed(law), every=1, out=tmp_path / "run")
    assert result.summary["truncated_sequences"] == 1
    assert result.impacts["problem"].max() > 2
    report = carom.audit.check(result)
    assert report.ok, report
    other = reworded(tmp_path / "run", tmp_path / "other", "restitution = 0.5", "restitution = 0.4")
    assert "impact" in kinds(carom.audit.check(other))


def test_impacts_within_frames_of_several_steps_are_said_to_be_unjudged() -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"step": 1e-3, "until": 0.3})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0.2), material="m")
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    result = carom.simulate(scene, contacts=True, impacts=True, every=10)
    report = carom.audit.check(result)
    for kind in ("impact sum", "impact speeds"):
        [unjudged] = report[kind].unjudged
        assert (unjudged.count, unjudged.cure) == (len(result.impacts), "every = 1 in [record]")
