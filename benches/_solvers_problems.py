"""The contact problems of solvers.py: heaps made here, the project's collection, and published ones where they are.

A heap is n spheres of radius 0.8 to 1 in a box, on a jittered lattice, pushed apart where they overlap while they sink; what
touches then is a contact. Velocities are random and a step of gravity is added, the impact problem of a heap that is
being shaken. Settled piles, which are harder by far, are in the collection.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import carom
import numpy as np
from _measure import ROOT
from _solvers_programs import F64, Problem
from carom.problem import ContactProblemWarning, Csr, GlobalProblem
from numpy.typing import NDArray

COLLECTION = ROOT / "tests" / "data" / "contact_problems"
PUBLISHED = Path(
    os.environ.get("CAROM_CONTACT_PROBLEMS", ROOT.parent / "shared" / "data" / "contact_problems")
)
#: Contacts, friction and seed of the heaps.
HEAPS = tuple((c, mu, seed) for seed, c in enumerate((100, 300, 747, 1000)) for mu in (0.3, 0.5, 0.7))
#: Of the published ones, those that take part in a quick run.
QUICK = ("Box_Stacks", "Capsules", "Confeti-ex13-Fc3D", "LMGC_100", "Spheres-i099", "spheres-in-a-box")
STEP, GRAVITY, SPEED = 0.01, 9.81, 0.5


def heap(contacts: int, friction: float, seed: int) -> carom.ContactProblem:
    """A heap of as many lowest spheres as have about `contacts` contacts, with one `friction` for all."""
    rng = np.random.default_rng(seed)
    n = round(contacts * 1.3) + 20
    radius = rng.uniform(0.8, 1.0, n)
    x, box = _settle(radius, rng)
    a, b, normal = _touching(x, radius, box)
    # Spheres from the floor up, until there are contacts enough.
    height = np.argsort(np.argsort(x[:, 2], kind="stable"), kind="stable")
    top = np.maximum(height[a], np.where(b < 0, 0, height[b]))
    kept = np.argsort(top, kind="stable")[:contacts]
    a, b, normal = a[kept], b[kept], normal[kept]
    mass = radius**3
    m = np.repeat(np.stack([mass, 0.4 * mass * radius**2], axis=1), 3, axis=1).reshape(-1)
    v = rng.normal(0.0, SPEED, (n, 6))
    v[:, 2] -= STEP * GRAVITY
    rows = np.arange(6 * n)
    return carom.ContactProblem(
        GlobalProblem(
            M=Csr.from_triplets(rows, rows, m, (6 * n, 6 * n), "M"),
            H=_directions(a, b, normal, radius),
            f=m * v.reshape(-1),
            w=np.zeros(3 * len(a)),
            mu=np.full(len(a), friction),
            title=f"heap of {len(a)} contacts, friction {friction}, seed {seed}",
        )
    )


def _settle(radius: F64, rng: np.random.Generator) -> tuple[F64, float]:
    """Centres (n, 3) after pushing apart while sinking, and the side of the box."""
    n = len(radius)
    side = max(2, round((n / 2) ** (1 / 3)))
    k = np.arange(n)
    x = (
        2.0 * np.stack([k % side, k // side % side, k // side**2], axis=1)
        + 1.0
        + rng.uniform(-0.2, 0.2, (n, 3))
    )
    box = 2.0 * side
    i, j = np.triu_indices(n, 1)
    for step in range(60):
        if step % 10 == 0:  # spheres move by less than 1 meanwhile
            near = np.sum((x[i] - x[j]) ** 2, axis=1) < 9.0
            p, q = i[near], j[near]
        d = x[p] - x[q]
        distance = np.linalg.norm(d, axis=1)
        push = (0.2 * np.maximum(radius[p] + radius[q] - distance, 0.0) / distance)[:, None] * d
        np.add.at(x, p, push)
        np.subtract.at(x, q, push)
        x[:, 2] -= 0.02 * 0.99**step
        x[:, :2] = np.clip(x[:, :2], radius[:, None], box - radius[:, None])
        x[:, 2] = np.maximum(x[:, 2], radius)
    return x, box


def _touching(x: F64, radius: F64, box: float) -> tuple[NDArray[np.int64], NDArray[np.int64], F64]:
    """Spheres a, b (C,) of the contacts, b = -1 for floor and walls, and their normals (C, 3) from b to a."""
    reach = 0.02
    a, b = np.triu_indices(len(radius), 1)
    d = x[a] - x[b]
    distance = np.linalg.norm(d, axis=1)
    on = distance - radius[a] - radius[b] <= reach
    first, second, normals = [a[on]], [b[on]], [d[on] / distance[on, None]]
    for axis, sign in ((2, 1.0), (0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        gap = (x[:, axis] if sign > 0 else box - x[:, axis]) - radius
        at = np.flatnonzero(gap <= reach)
        first.append(at)
        second.append(np.full(len(at), -1))
        normals.append(np.tile(sign * np.eye(3)[axis], (len(at), 1)))
    return np.concatenate(first), np.concatenate(second), np.concatenate(normals)


def _directions(a: NDArray[np.int64], b: NDArray[np.int64], normal: F64, radius: F64) -> Csr:
    """H (6 n, 3 C): column 3 c + k is the unit wrench on the bodies along direction k (N, T1, T2) of contact c."""
    c = len(a)
    least = np.argmin(np.abs(normal), axis=1)
    t1 = np.cross(normal, np.eye(3)[least])
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    frame = np.stack([normal, t1, np.cross(normal, t1)], axis=1)  # (C, direction, component)
    arm = np.cross(-normal[:, None, :], frame)  # of unit radius; the same for both bodies
    columns = np.broadcast_to(np.arange(3 * c).reshape(c, 3, 1), (c, 3, 3))
    parts = []
    for body, sign in ((a, 1.0), (b, -1.0)):
        on = body >= 0
        at = 6 * body[on][:, None, None] + np.arange(3)[None, None, :]
        rows = np.broadcast_to(at, (on.sum(), 3, 3))
        turn = radius[body[on]][:, None, None] * arm[on]
        parts += [(rows, columns[on], sign * frame[on]), (rows + 3, columns[on], turn)]
    row, column, value = (np.concatenate([part[k].reshape(-1) for part in parts]) for k in range(3))
    return Csr.from_triplets(row, column, value, (6 * len(radius), 3 * c), "H")


def problems(names: Sequence[str], quick: bool, files: Sequence[Path], say: list[str]) -> Iterator[Problem]:
    """All problems whose name contains one of `names` (all without any); what is absent is told in `say`.

    Without `files` these are heaps, collection and published problems, with `quick` a few of them; else the files,
    and those in folders among them.
    """

    def wanted(name: str) -> bool:
        return not names or any(part.lower() in name.lower() for part in names)

    for contacts, mu, seed in HEAPS if not files else ():
        name = f"heap-{contacts}-mu{mu}"
        if wanted(name) and (names or not quick or mu == 0.5):
            yield Problem(name, "heaps", heap(contacts, mu, seed))
    sources = (
        ("collection", [COLLECTION], "the project's collection of contact problems is not there"),
        ("published", [PUBLISHED], "no published problems; CAROM_CONTACT_PROBLEMS may name their folder"),
    )
    for group, places, absent in sources if not files else (("files", list(files), "no such files"),):
        paths = [path for place in places for path in _hdf5(place)]
        if not paths:
            say.append(f"Skipped: {absent}.")
        for path in paths:
            few = quick and group == "published" and not path.stem.startswith(QUICK)
            if wanted(path.stem) and (names or not few):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", ContactProblemWarning)  # small asymmetries: known
                    problem = carom.ContactProblem.from_fclib(path)
                    problem.local  # noqa: B018  bodies are eliminated before anything is timed
                yield Problem(path.stem, group, problem)


def _hdf5(place: Path) -> list[Path]:
    return (
        sorted(p for p in place.iterdir() if p.suffix in (".hdf5", ".h5"))
        if place.is_dir()
        else [place] * place.exists()
    )
