"""Same build, same scenario, same bits: any number of threads, whatever is recorded, alone or beside other runs.

Every comparison is of all recorded tables, byte by byte: frames, contacts, steps, impacts (so the order of events too),
residuals, and who came and went. `docs/reference/determinism.md` states what is promised and what is not.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom.cli.examples import find
from carom.result.record.layout import SOMETIMES, TABLES
from carom.run import loop as drive
from carom.run import sinks
from physics_scenes import R, balls
from trials import Trials

MOTION = tuple(f"frames/{name}" for name in ("position", "orientation", "velocity", "angular_velocity"))
SAME = "runs on several threads with the bits of one thread"
Recorded = dict[str, tuple[tuple[int, ...], bytes]]


def column(result: carom.Result, name: str) -> Any:
    return np.asarray(result._segments.column(*name.split("/")))


def everything(result: carom.Result) -> Recorded:
    """All that a run recorded: shape and bytes of each column of each table."""
    names = [f"{table}/{name}" for table in (*TABLES, *SOMETIMES) for name in result._segments.columns(table)]
    columns = {name: column(result, name) for name in names}
    return {name: (values.shape, values.tobytes()) for name, values in columns.items()}


def simulate(scene: carom.Scene, **options: Any) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # advice is not the matter here
        return carom.simulate(scene, **{"every": 1, **options})


def same(one: Recorded, other: Recorded, what: str) -> None:
    assert one.keys() == other.keys(), what
    assert not [name for name in one if one[name] != other[name]], what


# ------------------------------------------------------------------------------------------------------ scenes


def two_balls() -> carom.Scene:
    """An oblique hit with every kind of friction."""
    law = {"friction": 0.3, "restitution": 0.8, "tangential_restitution": 0.2, "rolling_radius": 1e-3,
           "spinning_radius": 5e-4}  # fmt: skip
    x, v = [[0, 0, 0], [0.1, 0.03, 0.01]], [[1.0, 0.1, 0], [-0.5, 0, 0.2]]
    return balls(x, v, [[0, 30, 5], [-20, 0, 9]], law=law, until=0.12)


def file(name: str, **options: Any) -> carom.Scene:
    return carom.Scene.from_toml(find(name)).with_options(**options)


def funnel() -> carom.Scene:
    """Balls of two inflows fall into a cone, meet there, pass its opening and leave."""
    scene = carom.Scene("funnel", run={"until": 0.3, "step": 1e-3})
    scene.contact("sand", "sand", friction=0.3, restitution=0.4)
    scene.contact("sand", "steel", friction=0.2, restitution=0.4)
    scene.cone("funnel", point=(0, 0, -0.05), axis=(0, 0, 1), radius=0.012, radius_end=0.1, length=0.1,
               material="steel")  # fmt: skip
    for k, x in enumerate((-0.03, 0.03)):
        scene.inflow(f"grain{k}-", count=20, rate=90.0, seed=k, radius=0.006, density=2500, material="sand",
                     region={"low": (x - 0.02, -0.03, 0.06), "high": (x + 0.02, 0.03, 0.08)},
                     velocity=(0, 0, -0.8), spread=0.2)  # fmt: skip
    scene.outlet(low=(-1, -1, -1), high=(1, 1, -0.08))
    return scene


def swing() -> carom.Scene:
    """Three balls on rods, the first let go against the others, and a spring: joints and loads in the impacts."""
    scene = carom.Scene("swing", run={"until": 0.4, "step": 1e-3})
    scene.contact("ball", "ball", friction=0.2, restitution=0.7)
    for k, x in enumerate((-0.05 - 2 * R, 0.0, 2 * R)):
        name = f"ball{k}"
        scene.sphere(name, radius=R, mass=0.17, material="ball", position=(x, 0.003 * k, 0),
                     velocity=(1.5 * (k == 0), 0, 0), angular_velocity=(0, 9, 0))  # fmt: skip
        scene.joint("rod", between=(name, "ground"), points=((x, 0.003 * k, 0), (x, 0.003 * k, 0.4)))
    scene.spring("ball1", "ball2", stiffness=40.0, damping=0.1)
    return scene


def grains(n: int = 300) -> carom.Scene:
    """Grains thrown into a box: a pile after some hundredths of a second."""
    rng, side, r, wide = np.random.default_rng(1), 6, 0.005, 2.14 * 0.005
    places = np.array([[i % side, i // side % side, i // side**2] for i in range(n)])
    places = places + np.array([0.5, 0.5, 0.55])
    box = wide * side
    walls = [((0, 0, 0), (0, 0, 1)), ((0, 0, 0), (1, 0, 0)), ((box, 0, 0), (-1, 0, 0)), ((0, 0, 0), (0, 1, 0)),
             ((0, box, 0), (0, -1, 0))]  # fmt: skip
    return balls(wide * places + 3e-4 * rng.uniform(-1, 1, (n, 3)), 0.2 * rng.uniform(-1, 1, (n, 3)), radius=r,
                 mass=2500 * 4.19 * r**3, gravity=(0, 0, -9.8), planes=walls, pile_tolerance=1e-4,
                 law={"friction": 0.4, "restitution": 0.3}, until=0.06, contacts_per_thread=20)  # fmt: skip


SCENES: dict[str, Callable[[], carom.Scene]] = {
    "two balls": two_balls,
    "break": lambda: file("5.6_break", until=0.3),
    "break, one-shot": lambda: file("5.6_break", until=0.3, impact="one-shot"),
    "break, moreau": lambda: file("5.6_break", until=0.3, method="moreau", position_projection=True),
    "two balls, penalty": lambda: two_balls().with_options(method="penalty", penalty_friction="spring"),
    "corner": lambda: file("corner", until=0.06),
    "shaken layer": lambda: file("shaken_layer", until=0.06, step=1e-3, contacts_per_thread=20),
    "shaken layer, moreau": lambda: file("shaken_layer", until=0.06, step=1e-3, method="moreau"),
    "funnel": funnel,
    "swing": swing,
    "300 grains": grains,
    "300 grains, moreau": lambda: grains().with_options(method="moreau", until=0.04),
}
# Islands are shared out however little their work is.
SHARED: dict[str, Any] = {"shared_contacts_per_thread": 1}
QUICK = (
    "two balls",
    "break, moreau",
    "corner",
    "shaken layer",
    "funnel",
    "swing",
    "300 grains",
    "two balls, penalty",
)
_KNOWN: dict[str, Recorded] = {}


def reference(name: str) -> Recorded:
    """The run on one thread with everything recorded; made once."""
    if name not in _KNOWN:
        result = simulate(SCENES[name](), threads=1)
        assert result.outcome.ok, name
        assert column(result, "steps/contacts").any() or "penalty" in name
        _KNOWN[name] = everything(result)
    return _KNOWN[name]


# ----------------------------------------------------------------------------------------------------- threads


@pytest.mark.parametrize("name", QUICK)
def test_threads_and_what_is_recorded_change_no_bit(name: str, trials: Trials) -> None:
    one = reference(name)
    with trials(SAME):
        same(one, everything(simulate(SCENES[name](), threads=3, **SHARED)), "3 threads")
    result = simulate(SCENES[name](), threads=8, **SHARED, every=7, contacts=False, impacts=False)
    thinned, frames = everything(result), column(result, "frames/step")
    for key in MOTION:
        whole = np.frombuffer(one[key][1]).reshape(one[key][0])
        assert thinned[key][1] == whole[frames].tobytes(), key
    # What the solver did is the same; `residuals` are histories of problems, kept with each step.
    assert all(one[key] == thinned[key] for key in one if key.startswith(("steps/", "residuals/", "events/")))
    assert len(result.contacts) == len(result.impacts) == 0


def lattice(layers: int, side: int = 16, speed: float = 1e-4) -> carom.Scene:
    """Square layers of touching balls, every second one smaller, each in the hollows of the one below, in a box without
    a lid, all with velocities up to `speed` in each direction: a single island that presses and slips."""
    rng, r = np.random.default_rng(4), 0.03125
    x = []
    for layer in range(layers):
        n = side - layer % 2
        low = -r * (n - 1)
        x += [(low + 2 * r * i, low + 2 * r * j, r + 2**0.5 * r * layer) for i in range(n) for j in range(n)]
    law = {"friction": 0.4, "restitution": 0.3}
    return balls(x, speed * rng.uniform(-1, 1, (len(x), 3)), radius=r, mass=0.25, gravity=(0, 0, -9.8), law=law,
                 planes=[((0, 0, 0), (0, 0, 1))], pile_tolerance=1e-3)  # fmt: skip


def check_threads(
    scene: carom.Scene, steps: int, threads: tuple[int, ...], least: int, trials: Trials, **options: Any
) -> None:
    """The same tables for each number of threads; an island of `least` contacts is swept."""
    options |= {"until": steps * 1e-3, "contacts": False}
    result = simulate(scene, threads=1, **options)
    assert column(result, "steps/largest_island").min() >= least
    # Where what the position level found holds, the velocity level has nothing to sweep.
    assert column(result, "steps/sweeps_velocity").max() > 2
    one = everything(result)
    for n in threads:
        with trials(SAME):
            same(one, everything(simulate(scene, threads=n, **options)), f"{n} threads")


def test_an_island_swept_by_several_threads(trials: Trials) -> None:
    """2400 balls are three chunks of the sweeps (`crates/carom-solve/src/spheres`), the least for threads to meet."""
    scene = lattice(10)
    assert 2048 < len(scene.names) < 3072
    check_threads(scene, 2, (8,), 6_000, trials, contacts_per_thread=1)


def cascade_of(threads: int) -> Recorded:
    """Balls of a lattice that fly apart and together: impact problems of hundreds of little islands for the threads."""
    result = simulate(lattice(6, speed=0.5), until=2e-3, threads=threads, contacts=False)
    assert column(result, "steps/impact_problems").max() > 10
    return everything(result)


def test_a_cascade_on_several_threads(trials: Trials) -> None:
    one = cascade_of(1)
    for threads in (2, 5):
        with trials(SAME):
            same(one, cascade_of(threads), f"{threads} threads")


def digest(recorded: Recorded) -> str:
    total = hashlib.sha256()
    for key, (shape, data) in sorted(recorded.items()):
        total.update(f"{key}{shape}".encode() + data)
    return total.hexdigest()


def test_a_fork_has_threads_of_its_own() -> None:
    """The threads of the parent do not exist in a process that it forks; a run there makes new ones."""
    here = digest(cascade_of(2))
    context = get_context("fork")
    there = context.SimpleQueue()
    child = context.Process(target=lambda: there.put(digest(cascade_of(2))), daemon=True)
    child.start()
    waited = threading.Timer(120.0, child.kill)
    waited.start()
    child.join()
    waited.cancel()
    assert child.exitcode == 0
    assert there.get() == here


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_one_to_eight_threads(name: str, trials: Trials) -> None:
    for n in range(2, 9):
        with trials(SAME):
            same(reference(name), everything(simulate(SCENES[name](), threads=n, **SHARED)), f"{n} threads")


@pytest.mark.long
@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_large_island_on_one_to_eight_threads(method: str, trials: Trials) -> None:
    """9000 balls: nine chunks, and three threads at the search for pairs; 8 threads at the sweeps."""
    check_threads(
        lattice(24, 20), 3, tuple(range(2, 9)), 23_000, trials, contacts_per_thread=1, method=method
    )


# ------------------------------------------------------------------------------------------- in parts and beside


@pytest.mark.parametrize("name", ["funnel", *(pytest.param(name, marks=pytest.mark.long) for name in SCENES)])
def test_checkpoints_however_often_and_a_run_in_parts(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trials: Trials
) -> None:
    """Blocks of seven steps, each with a checkpoint, and the run taken up in the middle."""
    monkeypatch.setattr(drive, "BLOCK_STEPS", 7)
    for constant, value in (
        ("FIRST_CHECKPOINT_SECONDS", 0.0),
        ("CHECKPOINT_SECONDS", 0.0),
        ("CHECKPOINT_SHARE", 1e9),
    ):
        monkeypatch.setattr(sinks, constant, value)
    scene = SCENES[name]()
    half = round(scene.run.until / scene.run.step) // 2 * scene.run.step  # type: ignore[operator]
    simulate(scene, until=half, out=tmp_path / "run")
    log = (tmp_path / "run" / "log.jsonl").read_text(encoding="utf-8")
    assert log.count('"checkpoint"') >= 3
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = carom.resume(tmp_path / "run", until=scene.run.until)
    with trials("runs in parts with the bits of one run"):
        same(reference(name), everything(result), "in parts")


def test_runs_side_by_side_in_one_process_do_not_meet() -> None:
    """Four runs at a time in threads of Python; what a run leaves in memory is no part of the next."""
    names = ["swing", "funnel", "shaken layer", "corner", "two balls", "swing"]
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda name: everything(simulate(SCENES[name]())), names))
    for name, run in zip(names, runs, strict=True):
        same(reference(name), run, name)


PROGRAM = """
import sys, test_determinism as t
print(*(t.digest(t.reference(name)) for name in sys.argv[1:]))
"""


def test_another_process_with_other_hashes_and_addresses() -> None:
    path = os.pathsep.join([str(Path(carom.__file__).parents[1]), str(Path(__file__).parent)])
    names = ["two balls", "funnel"]
    environment = {**os.environ, "PYTHONHASHSEED": "77", "MALLOC_PERTURB_": "77", "PYTHONPATH": path}
    command = [sys.executable, "-c", PROGRAM, *names]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [digest(reference(name)) for name in names]


# ----------------------------------------------------------------------------------- the comparison can fail


def test_a_single_bit_is_seen() -> None:
    scene = two_balls()
    moved = carom.Scene.from_toml(scene.to_toml().replace("0.03", repr(float(np.nextafter(0.03, 1)))))
    assert moved.spheres[1].position[1] != scene.spheres[1].position[1]
    with pytest.raises(AssertionError, match="two balls"):
        same(reference("two balls"), everything(simulate(moved)), "two balls")
