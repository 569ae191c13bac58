"""Gradients of joints, dampers and drag over the velocities of nodes, their masses, and what these answer to impulses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit.data import Run
from carom.audit.vectors import EPS, conjugate, cross, product, rotated, unit

Places = tuple[F64, F64]
"""Centres (A, N, 3) and orientations (A, N, 4)."""

#: Singular values of rows, over the largest: below these rows repeat one another, and in between nobody can tell.
SAME, UNSURE = 1e-10, 1e-6


def dampers(run: Run) -> list[dict[str, Any]]:
    return [load for load in run.loads if load["kind"] == "spring" and load["damping"] > 0.0]


def drags(run: Run) -> list[dict[str, Any]]:
    return [load for load in run.loads if load["kind"] == "drag"]


class Answer(NamedTuple):
    """Velocities over momenta of nodes in A intervals: `R (1 - (B G R)^T B G R) R^T`, with the root `R R^T` of their inverse
    masses (and dampers) in g blocks of s rows. Each of m rows of joints has numbers at its e ends alone.
    """

    root: F64
    """(A, g, s, s)"""
    ends: I64
    """(m, e) the block of each end, -1 for the ground."""
    seen: F64
    """(A, m, e, s) rows `G R`, each of length 1."""
    half: F64
    """(A, m, m) `B`, which makes rows orthonormal."""
    unsure: Bool
    """(A,)"""

    def of(self, momenta: F64, at: I64 | slice = slice(None)) -> F64:
        """(K, n, 6) velocities by momenta (K, n, 6), in the intervals `at` of these."""
        root, seen, half = self.root[at], self.seen[at], self.half[at]
        free = np.einsum("agij,agi->agj", root, momenta.reshape(root.shape[:3]))
        for _ in range(2):  # the second takes what rounding leaves of the first
            along = np.einsum("ames,ames->am", seen, free[:, self.ends])[..., None]
            along = half.swapaxes(1, 2) @ (half @ along)
            for row, ends in enumerate(self.ends):
                for end, block in enumerate(ends):
                    free[:, block] -= along[:, row] * seen[:, row, end]
        return np.asarray(np.einsum("agij,agj->agi", root, free).reshape(momenta.shape))


def answer(run: Run, bodies: I64, places: Places, *, answering: bool = True) -> Answer:
    """Of a group at some places, of joints alone without `answering` loads."""
    (ends, rows), (of_damped, damped) = _placed(run, bodies, places, answering=answering)
    weight = run.h * (float(run.options["theta"]) if run.method == "moreau" else 1.0)
    matrix = inert(run, bodies, places)
    for load in drags(run) if answering else ():
        if load["body"] in bodies and not run.in_clump[load["body"]]:
            at, six = int(np.searchsorted(bodies, load["body"])), np.arange(6)
            matrix[:, at, six, six] += weight * np.repeat([load["translation"], load["rotation"]], 3)
    if len(of_damped):  # these make one block of all nodes
        ways = _spread(of_damped, damped, len(bodies))
        matrix = _whole(matrix) + weight * (ways.swapaxes(1, 2) @ ways)[:, None]
        rows, ends = _spread(ends, rows, len(bodies))[:, :, None], np.zeros((len(ends), 1), dtype=np.int64)
    root = np.linalg.cholesky(np.linalg.inv(matrix))
    seen = np.zeros(rows.shape)
    for block in range(root.shape[1]):
        row, end = np.nonzero(ends == block)
        seen[:, row, end] = rows[:, row, end] @ root[:, block]
    seen /= np.maximum(np.sqrt((seen**2).sum(axis=(2, 3), keepdims=True)), 1e-300)
    return Answer(root, ends, seen, *_orthonormal(ends, seen, root.shape[1]))


def _orthonormal(ends: I64, seen: F64, blocks: int) -> tuple[F64, Bool]:
    """What makes rows orthonormal, nothing of those that repeat others, and whether that is unsure. In most intervals the
    root of their products does; where these are so near to singular that it may not, their singular values do.
    """
    intervals, many = seen.shape[:2]
    half, unsure = np.zeros((intervals, many, many)), np.zeros(intervals, dtype=bool)
    if not half.size:
        return half, unsure
    flat = seen.reshape(intervals, -1, seen.shape[-1])
    of, end = np.repeat(np.arange(many), ends.shape[1]), ends.ravel()
    i, j = np.nonzero((end[:, None] == end) & (end >= 0))
    products = np.zeros((many, many, intervals))
    np.add.at(products, (of[i], of[j]), np.einsum("aks,aks->ka", flat[:, i], flat[:, j]))
    products = np.moveaxis(products, 2, 0)
    shift = 64.0 * EPS * many * np.eye(many)  # where rows repeat one another there is a root, too
    half = np.linalg.inv(np.linalg.cholesky(products + shift))
    # At most the square of the largest singular value over the least.
    spread = np.abs(products).sum(axis=2).max(axis=1) * (half**2).sum(axis=(1, 2))
    doubted = np.flatnonzero(spread * UNSURE > 1.0)
    left, values, _ = np.linalg.svd(_spread(ends, seen[doubted], blocks), full_matrices=False)
    shares = values / np.maximum(values.max(axis=1, keepdims=True), 1e-300)
    least = np.where(shares > SAME, 1.0 / np.maximum(values, 1e-300), 0.0)
    half[doubted] = 0.0
    half[doubted, : values.shape[1]] = least[..., None] * left.swapaxes(1, 2)
    unsure[doubted] = ((shares > SAME) & (shares < UNSURE)).any(axis=1)
    return half, unsure


def _whole(blocks: F64) -> F64:
    """(A, 1, g s, g s) matrices of blocks (A, g, s, s) on their diagonal."""
    many, size = blocks.shape[1:3]
    found = np.zeros((len(blocks), many, size, many, size))
    found[:, np.arange(many), :, np.arange(many)] = blocks.swapaxes(0, 1)
    return found.reshape(-1, 1, many * size, many * size)


def _spread(ends: I64, rows: F64, blocks: int) -> F64:
    """(A, m, g s) whole rows of those at ends."""
    found = np.zeros((*rows.shape[:2], blocks, rows.shape[-1]))
    for end, numbers in zip(ends.T, rows.swapaxes(1, 2).swapaxes(0, 1), strict=True):
        found[:, np.arange(len(end)), end] += numbers
    return found.reshape(*rows.shape[:2], blocks * rows.shape[-1])


def largest(run: Run) -> F64:
    """(N,) largest moments of inertia of nodes, kg m^2."""
    found = run.node_inertia.copy()
    found[run.clumps.first] = run.clumps.most
    return found


def inert(run: Run, bodies: I64, places: Places) -> F64:
    """(A, n, 6, 6) masses and tensors of inertia of nodes at some places."""
    alone = np.repeat(np.stack([run.heavy[bodies], run.node_inertia[bodies]], axis=1), 3, axis=1)
    found = np.tile(alone[:, None] * np.eye(6), (len(places[0]), 1, 1, 1))
    for k, body in enumerate(bodies.tolist()):
        if run.in_clump[body]:
            axes = np.stack([rotated(_turns(run, body, places[1]), axis) for axis in np.eye(3)], axis=-1)
            moments = run.clumps.inertia[run.clump_of[body]]
            found[:, k, 3:, 3:] = np.einsum("aik,k,ajk->aij", axes, moments, axes)
    return found


def _turns(run: Run, body: int, q: F64) -> F64:
    """(A, 4) orientations of the clump of a ball, of those of all bodies (A, N, 4)."""
    turned = run.clumps.turned[np.searchsorted(run.clumps.balls, body)]
    return product(q[:, body], conjugate(turned))


def from_nodes(run: Run, body: I64, q: F64) -> F64:
    """(A, 3) centres of bodies (A,) from those of their nodes, m; `q` are the orientations of all (A, N, 4)."""
    found = np.zeros((len(q), 3))
    mine = np.flatnonzero(run.clump_of[body] >= 0)
    for ball in np.unique(body[mine]).tolist():
        rows = mine[body[mine] == ball]
        found[rows] = rotated(_turns(run, ball, q[rows]), run.clumps.offsets[ball])
    return found


def _placed(
    run: Run, bodies: I64, places: Places, *, answering: bool = True
) -> tuple[tuple[I64, F64], tuple[I64, F64]]:
    """Ends (rows, 2) and gradients (A, rows, 2, 6) of the joints of a group, and of its dampers times the roots of their
    coefficients.
    """
    held = [
        _gradient(run, row[:2], (joint["a"], row[2]), (joint["b"], row[3]), bodies, places)
        for joint in run.joints
        if run.node[joint["a"]] in bodies
        for row in joint["rows"]
    ]
    damped = []
    for load in dampers(run) if answering else ():
        if run.node[load["a"]] in bodies:
            ends = (load["a"], load["arm_a"]), (load["b"], load["arm_b"])
            at, numbers = _gradient(run, ("distance", None), *ends, bodies, places)
            damped.append((at, np.sqrt(load["damping"]) * numbers))
    for load in drags(run) if answering else ():
        if run.in_clump[load["body"]] and run.node[load["body"]] in bodies:
            damped += _dragged(run, load, bodies, places)
    none = np.zeros((0, 2), dtype=np.int64), np.zeros((len(places[0]), 0, 2, 6))
    both = [
        (np.stack([at for at, _ in of]), np.stack([numbers for _, numbers in of], axis=1)) if of else none
        for of in (held, damped)
    ]
    return both[0], both[1]


def _dragged(run: Run, load: dict[str, Any], bodies: I64, places: Places) -> list[tuple[I64, F64]]:
    """Gradients of the velocity and angular velocity of a ball of a clump, times the roots of its drag."""
    ball, ground, found = (load["body"], np.zeros(3)), (-1, np.zeros(3)), []
    for kind, key in (("point", "translation"), ("rotation", "rotation")):
        for axis in np.eye(3):
            at, numbers = _gradient(run, (kind, axis), ball, ground, bodies, places)
            found.append((at, np.sqrt(load[key]) * numbers))
    return found


def _gradient(
    run: Run, row: tuple[str, Any], a: tuple[int, Any], b: tuple[int, Any], bodies: I64, places: Places
) -> tuple[I64, F64]:
    """The nodes (2,) of A and B among `bodies`, -1 of the ground, and (A, 2, 6) `[d, R s_A x d], [-d, -R s_B x d]` of a
    point or distance, `[0, e], [0, -e]` of a rotation.
    """
    x, q = places
    kind, direction = row
    levers, at = [], []
    for body, arm in (a, b):
        given = np.broadcast_to(np.asarray(arm, dtype=np.float64), (len(x), 3))
        levers.append(rotated(q[:, body], given) if body >= 0 else np.zeros_like(given))
        at.append(x[:, body] + levers[-1] if body >= 0 else given)
    d = (
        unit(at[0] - at[1])
        if kind == "distance"
        else np.broadcast_to(np.asarray(direction, dtype=np.float64), (len(x), 3))
    )
    ends, found = np.full(2, -1), np.zeros((len(x), 2, 6))
    for end, ((body, _), lever, sign) in enumerate(zip((a, b), levers, (1.0, -1.0), strict=True)):
        if body >= 0:
            ends[end] = np.searchsorted(bodies, run.node[body])
            lever = lever + from_nodes(run, np.full(len(x), body), q)
            found[:, end, 3:] = sign * (d if kind == "rotation" else cross(lever, d))
            found[:, end, :3] = sign * (0.0 if kind == "rotation" else d)
    return ends, found
