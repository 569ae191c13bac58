"""A run of several parts is read if all its results are there, and refused in words if some are not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import carom
import fake_sim
import pytest
from carom import CaromError
from fake_runs import everything

FIRST, SECOND, THIRD = "results.h5", "results-0002.h5", "results-0003.h5"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three parts of 200, 100 and 50 steps."""
    path = tmp_path_factory.mktemp("lost") / "run"
    carom.simulate(fake_sim.hopping("one", "two"), until=0.2, out=path)
    for until in (0.3, 0.35):
        carom.resume(path, until=until)
    assert carom.load(path).segment_names == [FIRST, SECOND, THIRD]
    return path


def gone(name: str) -> Callable[[Path], object]:
    return lambda run: (run / name).unlink()


def over(source: str, target: str) -> Callable[[Path], object]:
    return lambda run: shutil.copyfile(run / source, run / target)


@pytest.mark.parametrize(
    ("lose", "named"),
    [
        (gone(FIRST), "results.h5 is missing"),
        (gone(SECOND), "results-0002.h5 is missing"),
        (gone(THIRD), "results-0003.h5 is missing; of the 350 steps of the run 300 are in"),
        (over(FIRST, SECOND), "results-0002.h5 begins after step 0 and not 200"),
        (over(FIRST, THIRD), "results-0003.h5 begins after step 0 and not 300"),
        (over(SECOND, FIRST), "results.h5 begins after step 200 and not 0"),
        (over(SECOND, THIRD), "results-0003.h5 begins after step 200 and not 300"),
        (over(THIRD, SECOND), "results-0002.h5 begins after step 300 and not 200"),
    ],
)
def test_a_lost_part_is_missed(run: Path, tmp_path: Path, lose: Callable[[Path], object], named: str) -> None:
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    lose(copy)
    for read in (carom.load, carom.resume):
        with pytest.raises(CaromError, match=named + r".*removed, replaced or cut.*--checkpoint start"):
            read(copy)
    with pytest.raises(CaromError, match=r"removed, replaced or cut.*--checkpoint (start|previous)"):
        carom.resume(copy, until=0.4)
    assert carom.resume(copy, checkpoint="start").outcome.ok
    assert everything(copy) == everything(run)


def test_what_does_not_count_may_be_missing(run: Path, tmp_path: Path) -> None:
    """A part that was killed before its file was there, and `run.json` without the list of parts."""
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    about = json.loads((copy / "run.json").read_text())
    killed = {"file": "results-0004.h5", "from_step": 350, "wall_s": 0.0, "core_s": 0.0}
    for listed in ([*about["segments"], killed], [*about["segments"], killed | {"to_step": 350}], None):
        changed = {key: value for key, value in about.items() if key != "segments"}
        changed |= {} if listed is None else {"segments": listed}
        (copy / "run.json").write_text(json.dumps(changed))
        assert everything(copy) == everything(run)


@pytest.mark.parametrize("keep", [True, False])
def test_parts_of_simulations_that_went_on_from_a_state_are_whole(tmp_path: Path, keep: bool) -> None:
    simulation = carom.Simulation(fake_sim.hopping("one", "two"), keep=keep)
    simulation.step(30)
    state = simulation.state()
    simulation.step(10)
    simulation.restore(state)
    simulation.step(5)
    assert len(simulation.result().save(tmp_path / "run").steps) == 5 * keep
