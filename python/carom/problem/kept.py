"""Contact problems as the core keeps them: rows over bodies at the solution found, with joints and loads.

The core states the problem of a step by its rows G over the bodies, contacts before joints, at the correction u that
it found (docs/theory/algorithm.md, sections 3 and 5):

    M u = G^T r + b(u),     z = G u + q,        and the conditions of the contacts on z and r, z = 0 for joints

with `b` the change of the loads that depend on the motion. Every contact has six rows;
those that no contact of the problem needs are left out here, so that all have 3, 5 or 6. Loads are replaced by their
tangent, `b(v) = b(u) - B (v - u)` with B the symmetric part of `-db/du` (any B gives the same solution), so that
`M + B` stands for M. Joints are eliminated, `z_J = 0`, by the Schur complement of their rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from carom.arrays import F64, I64
from carom.problem.cone import BLOCKS
from carom.problem.errors import ContactProblemWarning, refuse
from carom.problem.global_ import GlobalProblem, invert
from carom.problem.local import LocalProblem
from carom.problem.matrix import Csr, blocks, components, of_blocks

#: Degrees of freedom of a body; rows of a contact as the core keeps it.
DOF = ROWS = 6
#: Rows of joints that depend on one another, up to which they are eliminated (a dense matrix).
MAX_JOINT_ROWS = 3000
#: Share of the largest eigenvalue below which joints hold a motion more than once.
REDUNDANT = 1e-12

FORMS = ("local", "global")


def dimension_of(bounds: F64) -> int:
    """Rows of a contact that suffice for `bounds` (C, 3) of sliding, rolling and spinning."""
    return 6 if bounds[:, 2].any() else 5 if bounds[:, 1].any() else 3


def multipliers(kept: Mapping[str, Any]) -> F64:
    """(d C,) what the core found for the contacts of `state(kept)`."""
    found: F64 = np.asarray(kept["r"], dtype=np.float64)[_rows(kept)]
    return found


def moving(kept: Mapping[str, Any]) -> I64:
    """(n / 6,) the body that each six rows of `M` and `v` of the global form are of."""
    of_body, _ = _used(kept, _rows(kept))
    found: I64 = np.asarray(kept["spheres"], dtype=np.int64)[of_body >= 0]
    return found


def frames(kept: Mapping[str, Any]) -> F64:
    """(C, 3, 3) normal and tangents of the contacts, from B to A, world axes."""
    contacts = len(kept["bounds"])
    rows: F64 = np.asarray(kept["gradient"]).reshape(-1, 2, DOF)[: ROWS * contacts, 0, :3]
    return rows.reshape(contacts, ROWS, 3)[:, :3]


def state(kept: Mapping[str, Any], form: str = "local") -> LocalProblem | GlobalProblem:
    """The problem that the core kept.

    A problem with joints has no global form without them and is stated in local form whatever `form` says. In global
    form v is the velocity after the problem, or the displacement in the step; in both forms r and u are those of the core.
    """
    if form not in FORMS:
        raise refuse("form", repr(form), f"one of {', '.join(FORMS)}")
    bounds = np.asarray(kept["bounds"], dtype=np.float64).reshape(-1, 3)
    d = dimension_of(bounds)
    contact_rows = _rows(kept)
    joint_rows = np.arange(ROWS * len(bounds), len(kept["q"]))
    of_body, tangent = _used(kept, np.concatenate([contact_rows, joint_rows]))
    m, b = _inertia(kept, of_body, tangent)
    q = np.asarray(kept["q"], dtype=np.float64)
    text: dict[str, Any] = {
        "mu": bounds[:, 0],
        "mu_r": bounds[:, 1] if d > 3 else None,
        "mu_s": bounds[:, 2] if d > 5 else None,
        "dimension": d,
        "title": f"{kept['level']}-level contact problem of a run of Carom",
        "description": describe(kept),
        "math_info": "rows N, T1, T2, then R1, R2 (rolling) and S (spinning) where there are; W = G M^-1 G^T",
    }
    g = _gradient(kept, contact_rows, of_body)
    if form == "global" and not len(joint_rows):
        motion = np.asarray(kept["motion"], dtype=np.float64).reshape(-1, DOF)[of_body >= 0].reshape(-1)
        w = q[contact_rows] - g.dot(motion)
        return GlobalProblem(M=m, H=g.transpose, f=b + m.dot(motion), w=w, **text)
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", ContactProblemWarning
        )  # a stiff load may make M indefinite; W says it
        inverse = invert(m)
    weighted = inverse.multiply(g.transpose)
    v = inverse.dot(b)
    matrix, free = g.multiply(weighted), q[contact_rows] + g.dot(v)
    if len(joint_rows):
        j = _gradient(kept, joint_rows, of_body)
        between = j.multiply(weighted)
        held = _inverse_of_joints(j.multiply(inverse.multiply(j.transpose)))
        matrix = matrix.plus(between.transpose.multiply(held.multiply(between)), -1.0)
        free = free - between.transpose.dot(held.dot(q[joint_rows] + j.dot(v)))
    return LocalProblem(W=matrix.symmetric, q=free, **text)


def describe(kept: Mapping[str, Any]) -> str:
    """Where a problem is from, in a line."""
    part = f", part {kept['part']}" if kept["part"] else ""
    index = f", impact problem {kept['index']}" if kept["level"] == "velocity" else ""
    joints = f", {kept['joints']} joints eliminated" if kept["joints"] else ""
    ended = "" if kept["converged"] else ", not converged"
    return (
        f"step {kept['step']}{part}, t = {kept['time']:g} s, {kept['level']} level, island {kept['island']}{index}{joints};"
        f" {kept['iterations']} iterations, residual {kept['residual']:.3g}{ended}"
    )


# --- pieces -----------------------------------------------------------------------------------------------------------


def _rows(kept: Mapping[str, Any]) -> I64:
    """(d C,) the rows of contacts that the problem has, among all six of each."""
    bounds = np.asarray(kept["bounds"]).reshape(-1, 3)
    d = dimension_of(bounds)
    assert d in BLOCKS
    return (ROWS * np.arange(len(bounds))[:, None] + np.arange(d)).reshape(-1)


def _used(kept: Mapping[str, Any], rows: I64) -> tuple[I64, tuple[I64, I64, F64]]:
    """(nodes,) number of each node among those that rows or loads touch, -1 for others; the tangent of the loads."""
    at, to = (np.asarray(kept[f"load_tangent_{name}"], dtype=np.int64) for name in ("row", "column"))
    node = np.asarray(kept["node"], dtype=np.int64).reshape(-1, 2)[rows].reshape(-1)
    seen = np.zeros(len(kept["mass"]), dtype=bool)
    for index in (node[node >= 0], at // DOF, to // DOF):
        seen[index] = True
    number = np.where(seen, np.cumsum(seen) - 1, -1)
    return number, (at, to, np.asarray(kept["load_tangent_value"], dtype=np.float64))


def _inertia(kept: Mapping[str, Any], of_body: I64, tangent: tuple[I64, I64, F64]) -> tuple[Csr, F64]:
    """`M + B` over the used nodes, and `b(u) + B u`."""
    used = of_body >= 0
    size = DOF * int(used.sum())
    both = np.stack([np.asarray(kept["mass"])[used], np.asarray(kept["inertia"])[used]], axis=1)
    mass = np.repeat(both, DOF // 2, axis=1).reshape(-1)
    u, load = (np.asarray(kept[key]).reshape(-1, DOF)[used].reshape(-1) for key in ("correction", "load"))
    at, to = (DOF * of_body[index // DOF] + index % DOF for index in tangent[:2])
    half = 0.5 * tangent[2]
    shape = (size, size)
    soft = Csr.from_triplets(
        np.concatenate([at, to]), np.concatenate([to, at]), np.concatenate([half, half]), shape, "B"
    )
    diagonal = np.arange(size)
    m = Csr.from_triplets(diagonal, diagonal, mass, shape, "M").plus(soft)
    return m, load + soft.dot(u)


def _gradient(kept: Mapping[str, Any], rows: I64, of_body: I64) -> Csr:
    """(len(rows), 6 used nodes) the rows over the bodies."""
    gradient = np.asarray(kept["gradient"], dtype=np.float64).reshape(-1, 2, DOF)[rows]
    node = np.asarray(kept["node"], dtype=np.int64).reshape(-1, 2)[rows]
    row, side, k = np.nonzero((gradient != 0.0) & (node >= 0)[:, :, None])
    columns = DOF * of_body[node[row, side]] + k
    shape = (len(rows), DOF * int((of_body >= 0).sum()))
    return Csr.from_triplets(row, columns, gradient[row, side, k], shape, "G")


def _inverse_of_joints(matrix: Csr) -> Csr:
    """An inverse of J M^-1 J^T, group of joints by group; where joints hold a motion twice, on the range."""
    label = components(matrix)
    dense_of = np.bincount(label, minlength=1)
    if dense_of.max(initial=0) > MAX_JOINT_ROWS:
        cause = f"joints of {dense_of.max()} rows depend on one another"
        raise refuse("joints", cause, f"up to {MAX_JOINT_ROWS} are eliminated")
    found = []
    for members, dense in blocks(matrix, label):
        scale = np.sqrt(np.abs(np.diagonal(dense, axis1=1, axis2=2)))
        scale = np.where(scale > 0.0, scale, 1.0)
        both = scale[:, :, None] * scale[:, None, :]
        found.append((members, np.linalg.pinv(dense / both, rcond=REDUNDANT, hermitian=True) / both))
    return of_blocks(found, matrix.shape)
