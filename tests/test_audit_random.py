"""Random scenes are judged clean: walls that move and loads of every kind (`audit_random`), joints (`audit_rods`), all
features at once (`audit_mixed`), and method `events` (`audit_events`).
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from types import ModuleType

import audit_events
import audit_mixed
import audit_random
import audit_rods
import audit_scenes as scenes
import carom
import pytest
from carom import audit
from trials import Trials

#: Seeds of the quick tier: scenes that had been found at fault once, and the first ones.
FEW = [
    132,  # a contact of penalty whose impulses together pull: a normal the other way would cut them off
    220,  # a spring between balls that meet: it was taken for the places after the impact
    441,
    747,  # a damper whose ball was hit in the step before: the filter still has its force
    1648,  # an impact on a drum that turns, between frames: its velocity was taken at the place after the step
    1081,  # drag in Moreau-Jean beside a drum that turns: its velocity was taken at another place
    1940,  # a damper and impacts that turn velocities around and leave the kinetic energy as it is
    1999,  # the potential of a spring near its rest length, to a rounding of the coordinates
    189,  # not solved: a ball at rest with drag on a floor without gravity
    252,  # a moment in the penalty method, of a rounding of the spin
    659,  # a torque that turns back within a step: at both ends of it, it is the same
    *range(3),
]


@pytest.mark.parametrize(
    "seeds", [pytest.param(FEW, id="few"), pytest.param(range(700), id="many", marks=pytest.mark.long)]
)
def test_random_scenes_with_loads_are_clean(seeds: list[int], tmp_path: Path, trials: Trials) -> None:
    judged: set[str] = set()
    for seed in seeds:
        scene, options = audit_random.scene(seed)
        path = scenes.run(scene, tmp_path / str(seed), audit_random.UNTIL, **options)
        with trials("random scenes with loads judged clean"):
            report = audit.check(path)
            assert report.ok, f"seed {seed}: {report!r}"
        judged |= {kind for kind, verdict in report.verdicts.items() if verdict.judged}
    assert {"momentum", "spin", "friction cone", "energy rise", "impact"} <= judged


@pytest.mark.parametrize(
    "seeds",
    [
        # 107 stopped while a clump had a contact within; 266: momentum of joints was that of the solver, not to rounding.
        pytest.param([16, 18, 37, 41, 47, 107, 117, 266, *range(3)], id="few"),
        pytest.param(range(200), id="many", marks=pytest.mark.long),
    ],
)
def test_random_scenes_with_rods_and_clumps_are_clean(
    seeds: list[int], tmp_path: Path, trials: Trials
) -> None:
    """No file has what joints move at the position level; where it was not bounded, 61 of the 200 were accused."""
    for seed in seeds:
        scene, options = audit_rods.scene(seed)
        report = audit.check(scenes.run(scene, tmp_path / str(seed), audit_rods.UNTIL, **options))
        with trials("random scenes with joints judged clean"):
            assert report.ok, f"seed {seed}: {report!r}"


@pytest.mark.parametrize(
    "seeds",
    [
        # Each was found at fault once: bounds of reactions, of loads after a step in parts, of prescribed motion; a contact
        # that repeats a joint (218), springs where smooth motion ends (310), reactions that the filter carries (319, 385).
        pytest.param([16, 17, 23, 25, 37, 44, 138, 160, 170, 218, 310, 319, 385], id="few"),
        pytest.param(range(200), id="many", marks=pytest.mark.long),
    ],
)
def test_random_scenes_of_every_feature_are_clean(seeds: list[int], tmp_path: Path, trials: Trials) -> None:
    for seed in seeds:
        scene, options = audit_mixed.scene(seed)
        with suppress(
            carom.RunFailed
        ):  # some joints jam with contacts, and say so: what was done until then is judged
            scenes.run(scene, tmp_path / str(seed), audit_mixed.UNTIL, **options)
        with trials("random scenes of every feature judged clean"):
            report = audit.check(tmp_path / str(seed))
            assert report.ok, f"seed {seed}: {report!r}"


@pytest.mark.parametrize(
    "source", [audit_random, audit_rods, audit_mixed], ids=lambda module: module.__name__
)
@pytest.mark.parametrize(
    "seeds",
    [
        pytest.param([15, 31, 67, 81, 91], id="few"),
        pytest.param(range(100), id="many", marks=pytest.mark.long),
    ],
)
def test_random_scenes_whose_loads_are_solved_once_are_clean(
    seeds: list[int], source: ModuleType, tmp_path: Path, trials: Trials
) -> None:
    for seed in seeds:
        scene, options = source.scene(seed)
        if options.get("method", "nsga") != "nsga":
            continue
        with suppress(carom.RunFailed):  # what was done until then is judged
            scenes.run(scene, tmp_path / str(seed), source.UNTIL, **{**options, "position_friction": "once"})
        with trials("random scenes with loads solved once judged clean"):
            report = audit.check(tmp_path / str(seed))
            assert report.ok, f"seed {seed}: {report!r}"


@pytest.mark.parametrize(
    "seeds",
    [
        pytest.param([112, 260, *range(6)], id="few"),
        pytest.param(range(300), id="many", marks=pytest.mark.long),
    ],
)
def test_random_scenes_of_events_are_clean(seeds: list[int], tmp_path: Path, trials: Trials) -> None:
    for seed in seeds:
        scene, options = audit_events.scene(seed)
        with suppress(
            carom.RunFailed
        ):  # some motions have no closed form: what was done until then is judged
            scenes.run(scene, tmp_path / str(seed), audit_events.UNTIL, **options)
        with trials("random scenes of method events judged clean"):
            report = audit.check(tmp_path / str(seed))
            assert report.ok, f"seed {seed}: {report!r}"
