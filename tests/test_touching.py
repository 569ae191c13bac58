"""Which contacts are closed at a frame: `/contacts` has all since the frame before, as they were when last closed.

A ball that bounced between two frames was counted as touching at the second, far above the floor: coordination numbers of
moving grains were up to a third too large, and figures showed bounces as times of sticking.
"""

from __future__ import annotations

from collections.abc import Callable

import carom
import numpy as np
import pytest
from carom import granular

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")
R = 0.01
LAW = {"friction": 0.3, "restitution": 0.0}


def test_a_ball_that_bounced_between_two_frames_touches_nothing() -> None:
    high = carom.Scene("bounce", run={"until": 0.4, "step": 1e-3}, record={"every": 40})
    high.contact("m", "m", friction=0.2, restitution=0.8)
    high.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    high.sphere("b", radius=R, mass=0.01, material="m", at=(0, 0, 0.06), velocity=(0.3, 0, 0))
    result = carom.simulate(high)
    bounced = [k for k in range(1, len(result.time)) if len(result.contacts.at(k))]
    assert len(bounced) == 3
    for k in bounced:
        assert result.position[k, 0, 2] > 0.0125  # well above the floor
        s = granular.snapshot(result, k)
        assert not s.touching.closed.any()
        assert s.touching.push[0] > 0.1  # N, of the bounce
        assert granular.coordination(s).mean == 0.0
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
    assert set(result.plot.chart("phases").data["status"]) == {"open"}


TURN = {"rotation": {"axis": (0, 1, 0), "point": (0, 0, 0), "rate": 2.0}}
LIFT = {"translation": [0, 0, {"expression": "0.2*t"}]}


def drum(s: carom.Scene) -> None:
    s.cylinder("wall", point=(0, 0, 0), axis=(0, 1, 0), radius=0.05, material="m", motion=TURN)
    s.sphere("b", radius=R, mass=0.01, material="m", at=(0, 0, -0.04))


def bowl(s: carom.Scene) -> None:
    s.ball_wall("wall", point=(0.3, 0, 0), radius=0.05, inside=True, material="m", motion=LIFT)
    s.sphere("b", radius=R, mass=0.01, material="m", at=(0.3, 0, -0.04), velocity=(0, 0.1, 0.2))


def plate(s: carom.Scene) -> None:
    s.plane("wall", point=(0, 0, 0), normal=(0, 0, 1), radius=0.1, material="m", motion=LIFT)
    s.sphere("b", radius=R, mass=0.01, material="m", at=(0, 0, R), velocity=(0, 0, 0.2))
    s.sphere("c", radius=R, mass=0.01, material="m", at=(0, 2 * R, R), velocity=(0, -0.1, 0.2))


@pytest.mark.parametrize("build", [drum, bowl, plate])
def test_the_gap_to_a_wall_is_that_of_where_it_is_at_the_frame(build: Callable[[carom.Scene], None]) -> None:
    """The core recorded the same."""
    s = carom.Scene(build.__name__, run={"until": 0.1, "step": 1e-3}, record={"every": 1})
    s.contact("m", "m", **LAW)
    build(s)
    result = carom.simulate(s)
    for k in (1, 50, 100):
        rows = result.contacts.at(k)
        assert "b - wall" in {" - ".join(pair) for pair in np.asarray(rows["pair"])}
        assert granular.snapshot(result, k).touching.closed.all(), k
        gap = result.walls["wall"].gap(
            result.position[k], np.full(len(result.names), R), np.full(len(result.names), result.time[k])
        )
        for (a, b), recorded in zip(
            np.asarray(rows["body"]).astype(int), np.asarray(rows["gap"]), strict=True
        ):
            if b == len(result.names):
                assert gap[a] == pytest.approx(recorded, abs=1e-12)


def test_contacts_of_a_pile_are_closed_within_its_tolerance() -> None:
    """Those that carry it are up to some 1e-5 of a radius apart at a coarse tolerance."""
    pile = carom.Scene("pile", run={"until": 1.0, "step": 1e-3, "pile_tolerance": 1e-4}, record={"every": 25})
    pile.contact("m", "m", **LAW)
    pile.box("box", low=(-0.03, -0.03, 0), high=(0.03, 0.03, 0.5), open=["high_z"], material="m")
    pile.lattice("b", material="m", radius=R, density=2500, counts=(2, 2, 4), origin=(-0.012, -0.012, 0.011), spacing=0.0215,
                 jitter=0.0005, seed=3)  # fmt: skip
    s = granular.snapshot(carom.simulate(pile))
    assert s.touching.closed[s.touching.push > 1e-3 * s.touching.push.max()].all()
