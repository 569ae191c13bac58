"""The cases of `tools/bits.py`: what each one runs, and one hash for each step of every column that it records.

A case is named `kind/name`. Each is a function of the number of threads that returns its columns. This file uses the
public interface of Carom alone, so that it runs with builds of other commits.
"""

from __future__ import annotations

import functools
import hashlib
import json
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "validation" / "drops"))

#: Steps (or places) of a column, and a hash of what it holds at each of them.
Column = tuple[NDArray[np.int64], NDArray[np.uint64]]
Columns = dict[str, Column]
Case = Callable[..., Columns]

FOLDERS = {
    "paper": ROOT / "scenarios" / "paper",
    "scenarios": ROOT / "scenarios",
    "wedged": ROOT / "tests" / "data" / "wedged",
}

#: Steps of the scenarios that would take minutes; others run to their end.
STEPS = {"short": 100, "full": 400}
#: Grains of the scenarios that take a number of them.
GRAINS = {"short": 200, "full": 1000}
DROPS = {"short": 8, "full": 100}
#: Contacts up to which a collected problem is solved.
CONTACTS = {"short": 150, "full": 100_000}
ITERATIONS = 500
#: Scenarios by method `penalty`, and their steps: collisions in a row, a break, rolling, jammed balls, a moving wall.
PENALTY = {"newtons_cradle": 500, "nine_ball_break": 2500, "incline": 100, "corner": 400, "shaken_layer": 300}
SOLVERS = ("auto", "gauss-seidel", "newton")


def digest(values: NDArray[Any]) -> int:
    """A hash of 64 bits of the bytes of an array."""
    return int.from_bytes(hashlib.blake2b(np.ascontiguousarray(values), digest_size=8).digest(), "little")


def hashes(values: NDArray[Any], steps: NDArray[np.int64]) -> Column:
    """One hash for each run of equal `steps`, which has one number for each row of `values`."""
    starts = np.flatnonzero(np.diff(steps, prepend=steps[:1] - 1))
    parts = np.split(values, starts[1:]) if len(starts) else []
    return steps[starts], np.array([digest(part) for part in parts], dtype=np.uint64)


def spread(ends: NDArray[np.int64], steps: NDArray[np.int64], rows: int) -> NDArray[np.int64]:
    """The step of each of `rows` rows of a table whose parts, of `steps`, end at `ends`, counted over all files."""
    before = ends.astype(np.int64)[-1:] - rows
    return np.repeat(steps.astype(np.int64), np.diff(ends.astype(np.int64), prepend=before))


def table(group: h5py.Group, steps: NDArray[np.int64]) -> Iterator[tuple[str, Column]]:
    """The columns of a table of the results file."""
    for name, data in group.items():
        if isinstance(data, h5py.Dataset) and len(data) == len(steps):
            yield f"{group.name[1:]}/{name}", hashes(data[()], steps)


def tables(path: Path) -> Iterator[tuple[str, Column]]:
    """The columns of all tables of a results file."""
    with h5py.File(path) as file:
        for group in file.values():
            if isinstance(group, h5py.Group) and "step" in group:
                yield from table(group, group["step"][()].astype(np.int64))
        frames = file["frames"]
        if "contact_end" in frames and "contacts" in file:
            rows = len(next(iter(file["contacts"].values())))
            yield from table(file["contacts"], spread(frames["contact_end"][()], frames["step"][()], rows))
        if "residuals" in file:
            group = file["residuals"]
            rows = spread(group["end"][()], group["step"][()], len(group["value"]))
            yield "residuals/value", hashes(group["value"][()], rows)


def recorded(folder: Path) -> Columns:
    """All that a run wrote: every column of its results, and the arrays of its last state."""
    found: Columns = {}
    # Long recordings fill several files.
    for path in sorted(folder.glob("results*.h5"), key=lambda path: (len(path.name), path.name)):
        for name, column in tables(path):
            before = found.get(name, (column[0][:0], column[1][:0]))
            found[name] = np.concatenate([before[0], column[0]]), np.concatenate([before[1], column[1]])
    checkpoints = sorted(folder.glob("checkpoint-*.npz"), key=lambda path: int(path.stem.split("-")[1]))
    with np.load(checkpoints[-1]) as state:
        for name in sorted(set(state.files) - {"head", "sha256"}, key=int):
            found[f"last state/{name}"] = np.zeros(1, np.int64), np.array([digest(state[name])], np.uint64)
    return found


def run(scene: Any, *, threads: int, steps: int | None = None) -> Columns:
    """A scene to its end, or for `steps`, with everything recorded. How it ends is a column too."""
    import carom

    until = (scene.run.until or 1.0) if steps is None else min(scene.run.until or 1.0, steps * scene.run.step)
    options = {"threads": threads, "until": until, "contacts": True, "impacts": "every", "every": 1}
    # Nothing is too small to be shared: the threads are really at work.
    options |= {"contacts_per_thread": 1, "shared_contacts_per_thread": 1} if threads > 1 else {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome = "done"
        try:
            outcome = str(carom.simulate(scene, out=Path(folder, "run"), **options).outcome)
        except carom.CaromError as error:  # a run that stops has its results all the same
            outcome = str(error).splitlines()[0]
        found = recorded(Path(folder, "run"))
    found["outcome"] = np.zeros(1, np.int64), np.array([digest(np.frombuffer(outcome.encode(), np.uint8))])
    return found


def restored(path: Path, *, threads: int) -> Columns:
    """One step from a state that is kept beside its scene."""
    import carom
    from carom import _core

    scene = carom.Scene.from_toml(path).with_options(threads=threads)
    simulation = _core.Simulation(scene.to_model())
    with np.load(path.with_suffix(".npz")) as state:
        simulation.restore(dict(state))
    simulation.advance(1, 0, False, 1e9)
    place = np.zeros(1, np.int64)
    return {f"frames/{name}": (place, np.array([digest(np.asarray(values))], np.uint64))
            for name, values in simulation.frame().items()}  # fmt: skip


def solved(path: Path, solver: str, *, threads: int) -> Columns:
    """A collected contact problem, solved."""
    import carom

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solution = carom.ContactProblem.from_fclib(path).solve(
            solver=solver, threads=threads, max_iterations=ITERATIONS, on_nonconvergence="return"
        )
    place = np.zeros(1, np.int64)
    return {"impulses": (place, np.array([digest(np.asarray(solution.r))], np.uint64))}


def variants(path: Path) -> list[str | None]:
    """The cases of a scenario file, or None for one that has none."""
    named = tomllib.loads(path.read_text(encoding="utf-8")).get("case", [])
    return [entry["name"] for entry in named] or [None]


def scenarios(size: str) -> Iterator[tuple[str, Case]]:
    """The scenarios that come with Carom, those of the paper, and the states of jammed balls."""
    import carom

    for kind, folder in FOLDERS.items():
        for path in sorted(folder.glob("*.toml")):
            parameters = {"N": GRAINS[size]} if path.stem == "pile" else None
            for case in variants(path):
                scene = carom.Scene.from_toml(path, case=case, set=parameters)
                name = f"{kind}/{path.stem}" + (f"/{case}" if case else "")
                steps = None if kind == "paper" and size == "full" else STEPS[size]
                yield name, functools.partial(run, scene, steps=steps)
            if path.with_suffix(".npz").exists():
                yield f"{kind}/{path.stem}/restored", functools.partial(restored, path)


def drops(size: str) -> Iterator[tuple[str, Case]]:
    """Random drops of balls into boxes, half of them narrow (`validation/drops/drops.py`)."""
    import drops as source

    for seed in range(DROPS[size]):
        narrow = seed % 2 == 1
        scene = source.scene(8 if narrow else 30, seed, source.NARROW if narrow else source.WIDE)
        options = {"until": scene.run.step * STEPS[size], "pile_tolerance": 1e-7 if narrow else 1e-4}
        yield f"drops/{seed}", functools.partial(run, scene.with_options(**options))


def periodic(size: str) -> Iterator[tuple[str, Case]]:
    """Grains with different speeds in a box that repeats in x and y."""
    import carom

    scene = carom.Scene("periodic", periodic=(0.06, 0.06, 0.0), run={"step": 1e-3, "until": 1.0})
    scene.contact("grain", "grain", friction=0.4, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.packing("p", count=GRAINS[size] // 4, sizes="equal", diameter=0.008, density=2500, material="grain", seed=3,
                  region="box", low=(0, 0, 0.0), high=(0.06, 0.06, 0.2), periodic="xy")  # fmt: skip
    yield "periodic/box", functools.partial(run, scene, steps=STEPS[size])


def sticky(size: str) -> Iterator[tuple[str, Case]]:
    """Balls and clumps that stick to one another, under a free lid in a box that shears."""
    import carom

    scene = carom.Scene("sticky", periodic=(0.03, 0.03, 0.0), run={"step": 5e-4, "until": 1.0})
    scene.contact("grain", "grain", friction=0.4, restitution=0.3, cohesion=0.02, rupture_distance=1e-4)
    scene.contact("grain", "wall", friction=0.0, restitution=0.3, cohesion=0.01, rupture_distance=1e-4)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    free = {"mass": 0.01, "force": 0.1}
    scene.plane("lid", point=(0, 0, 0.05), normal=(0, 0, -1), material="wall", free=free)
    for k in range(18):
        place = (0.01 * (k % 3) + 0.003, 0.01 * (k // 3 % 3) + 0.003, 0.008 + 0.012 * (k // 9))
        spheres = [[-0.002, 0, 0, 0.002], [0.002, 0, 0, 0.002]] if k % 3 else [[0, 0, 0, 0.004]]
        common = {"density": 2500, "material": "grain", "velocity": (0.1 * (k % 3 - 1), 0, -0.2)}
        scene.clump(f"c{k}", spheres=spheres, at=place, orientation=(0.6, 0, 0.8, 0), **common)
        beside = (place[0] + 0.005, place[1] + 0.005, place[2])
        scene.sphere(f"b{k}", radius=0.002, at=beside, **common)
    scene.deform(shear="2*t", flow="x", gradient="y")
    yield "sticky/clumps", functools.partial(run, scene, steps=STEPS[size])


def held(size: str) -> Iterator[tuple[str, Case]]:
    """Clumps with joints, springs, drag and loads, one of them over a floor."""
    import carom

    scene = carom.Scene("held", run={"step": 1e-3, "until": 1.0})
    scene.contact("grain", "grain", friction=0.4, restitution=0.5, tangential_restitution=0.2)
    scene.plane("floor", material="grain", point=(0, 0, 0), normal=(0.1, 0, 1))
    rod = [[-0.012, 0, 0, 0.01], [0.012, 0, 0, 0.008], [0.02, 0.01, 0, 0.005]]
    for k in range(3):
        scene.clump(
            f"rod{k}-", material="grain", spheres=rod, density=2500, position=(0.06 * k, 0, 0.05 + 0.02 * k)
        )
    scene.joint("ball", between=("rod0-2", "rod1-1"), point=(0.03, 0, 0.06))
    scene.joint("fix", body="rod1-2")
    scene.spring("rod2-1", "ground", points=[(0.108, 0.01, 0.09), (0.1, 0, 0.3)], stiffness=5.0, damping=0.02)
    scene.drag("all", translation=0.01, rotation=1e-6)
    scene.load("rod2-2", force=(0, {"expression": "0.01*sin(50*t)"}, 0), torque=(1e-5, 0, 0))
    yield "held/clumps", functools.partial(run, scene, steps=STEPS[size])


def events(size: str) -> Iterator[tuple[str, Case]]:
    """A break by method `events`."""
    from carom import billiards

    table = billiards.table("9ft")
    scene = table.scene("break", until=1.0, method="events", step=0.1)
    table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=1)
    billiards.strike(table.cue_ball(scene, at="head spot"), speed="20 mph", direction="0 deg", height=0.1)
    yield "events/break", functools.partial(run, scene)


def penalty(size: str) -> Iterator[tuple[str, Case]]:
    """Balls whose contacts are springs and dampers, soft ones so that the cases are short; both laws of sliding friction."""
    import carom

    for stem, steps in PENALTY.items():
        scene = carom.Scene.from_toml(ROOT / "scenarios" / f"{stem}.toml")
        for friction in ("regularised", "spring"):
            options = {"method": "penalty", "penalty_friction": friction, "penalty_young_modulus": 1e7}
            case = functools.partial(run, scene.with_options(**options), steps=steps)
            yield f"penalty/{stem}/{friction}", case


def problems(size: str) -> Iterator[tuple[str, Case]]:
    """The collected contact problems, by several solvers."""
    folder = ROOT / "tests" / "data" / "contact_problems"
    index = json.loads((folder / "index.json").read_text(encoding="utf-8"))["problems"]
    for entry in index:
        if entry["contacts"] <= CONTACTS[size]:
            path = folder / entry["file"]
            for solver in SOLVERS:
                yield f"problems/{path.stem}/{solver}", functools.partial(solved, path, solver)


def every(size: str) -> dict[str, Case]:
    """All cases of a size, `short` or `full`, by name."""
    sources = (scenarios, drops, periodic, sticky, held, events, penalty, problems)
    return {name: case for source in sources for name, case in source(size)}
