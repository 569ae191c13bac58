"""Gradients of joints, dampers and drag over the velocities of nodes, their masses, and what these answer to impulses."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit.data import Run
from carom.audit.vectors import conjugate, cross, product, rotated, unit

Places = tuple[F64, F64]
"""Centres (A, N, 3) and orientations (A, N, 4)."""

#: Singular values of rows, over the largest: below these rows repeat one another, and in between nobody can tell.
SAME, UNSURE = 1e-10, 1e-6


def dampers(run: Run) -> list[dict[str, Any]]:
    return [load for load in run.loads if load["kind"] == "spring" and load["damping"] > 0.0]


def drags(run: Run) -> list[dict[str, Any]]:
    return [load for load in run.loads if load["kind"] == "drag"]


def answer(run: Run, bodies: I64, places: Places, *, answering: bool = True) -> tuple[F64, Bool]:
    """(A, 6n, 6n) velocities over momenta of a group at some places, of joints alone without `answering` loads, and (A,)
    where they are not sure.
    """
    rows, damped = _placed(run, bodies, places, answering=answering)
    weight = run.h * (float(run.options["theta"]) if run.method == "moreau" else 1.0)
    matrix = inert(run, bodies, places)
    for load in drags(run) if answering else ():
        if load["body"] in bodies and not run.in_clump[load["body"]]:
            at = 6 * int(np.searchsorted(bodies, load["body"])) + np.arange(6)
            matrix[:, at, at] += weight * np.repeat([load["translation"], load["rotation"]], 3)
    matrix = matrix + weight * np.einsum("ari,arj->aij", damped, damped)
    inverse = np.linalg.inv(matrix)
    if not rows.shape[1]:
        return inverse, np.zeros(len(rows), dtype=bool)
    root = np.linalg.cholesky(inverse)
    seen = rows @ root
    seen = seen / np.maximum(np.linalg.norm(seen, axis=2, keepdims=True), 1e-300)
    _, values, along = np.linalg.svd(seen, full_matrices=False)
    shares = values / values.max(axis=1, keepdims=True)
    held = along * (shares > SAME)[:, :, None]
    unsure = ((shares > SAME) & (shares < UNSURE)).any(axis=1)
    return inverse - root @ (held.transpose(0, 2, 1) @ held) @ root.transpose(0, 2, 1), unsure


def largest(run: Run) -> F64:
    """(N,) largest moments of inertia of nodes, kg m^2."""
    found = run.node_inertia.copy()
    found[run.clumps.first] = run.clumps.most
    return found


def inert(run: Run, bodies: I64, places: Places) -> F64:
    """(A, 6n, 6n) masses and tensors of inertia of nodes at some places."""
    alone = np.repeat(np.stack([run.heavy[bodies], run.node_inertia[bodies]], axis=1), 3, axis=1).ravel()
    found = np.tile(np.diag(alone), (len(places[0]), 1, 1))
    for k, body in enumerate(bodies.tolist()):
        if run.in_clump[body]:
            axes = np.stack([rotated(_turns(run, body, places[1]), axis) for axis in np.eye(3)], axis=-1)
            at = slice(6 * k + 3, 6 * k + 6)
            moments = run.clumps.inertia[run.clump_of[body]]
            found[:, at, at] = np.einsum("aik,k,ajk->aij", axes, moments, axes)
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


def _placed(run: Run, bodies: I64, places: Places, *, answering: bool = True) -> tuple[F64, F64]:
    """Gradients (A, rows, 6n) of the joints of a group, and of its dampers times the roots of their coefficients."""
    held = [
        _gradient(run, row[:2], (joint["a"], row[2]), (joint["b"], row[3]), bodies, places)
        for joint in run.joints
        if run.node[joint["a"]] in bodies
        for row in joint["rows"]
    ]
    damped = [
        np.sqrt(load["damping"])
        * _gradient(
            run, ("distance", None), (load["a"], load["arm_a"]), (load["b"], load["arm_b"]), bodies, places
        )
        for load in dampers(run)
        if answering and run.node[load["a"]] in bodies
    ]
    for load in drags(run) if answering else ():
        if run.in_clump[load["body"]] and run.node[load["body"]] in bodies:
            damped += _dragged(run, load, bodies, places)
    none = np.zeros((len(places[0]), 0, 6 * len(bodies)))
    return tuple(np.stack(g, axis=1) if g else none for g in (held, damped))  # type: ignore[return-value]


def _dragged(run: Run, load: dict[str, Any], bodies: I64, places: Places) -> list[F64]:
    """Gradients (A, 6n) of the velocity and angular velocity of a ball of a clump, times the roots of its drag."""
    ground = (-1, np.zeros(3))
    return [
        np.sqrt(load[key]) * _gradient(run, (kind, axis), (load["body"], np.zeros(3)), ground, bodies, places)
        for kind, key in (("point", "translation"), ("rotation", "rotation"))
        for axis in np.eye(3)
    ]


def _gradient(
    run: Run, row: tuple[str, Any], a: tuple[int, Any], b: tuple[int, Any], bodies: I64, places: Places
) -> F64:
    """(A, 6n) `[d, R s_A x d, -d, -R s_B x d]` of a point or distance, `[0, e, 0, -e]` of a rotation."""
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
    found = np.zeros((len(x), len(bodies), 6))
    for (body, _), lever, sign in zip((a, b), levers, (1.0, -1.0), strict=True):
        if body >= 0:
            mine = np.searchsorted(bodies, run.node[body])
            lever = lever + from_nodes(run, np.full(len(x), body), q)
            found[:, mine, 3:] += sign * (d if kind == "rotation" else cross(lever, d))
            found[:, mine, :3] += sign * (0.0 if kind == "rotation" else d)
    return found.reshape(len(x), 6 * len(bodies))
