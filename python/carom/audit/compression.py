"""Impulses of compression of Poisson's law, which no table has: those that stop the motion before the step.

    0 <= z_N, P_N >= 0, P_N z_N = 0,   P_T = the nearest in the disc of radius mu P_N to P_T - z_T/D_TT,   z = G v_n + W P

over the contacts of a group, by sweeps and Newton's method on dense matrices. Of a group with more than `MOST` contacts,
with rolling or spinning bounds, with joints, dampers or clumps, and of one whose solution was not found or is not one,
nothing is known.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.audit.data import Run
from carom.audit.hits import Hits

#: Contacts of a group: its matrix has three rows for each.
MOST = 60
#: Rounds of sweeps and a step of Newton's method, and the residual over the largest impulse that ends them.
ROUNDS, SWEEPS, SOLVED = 60, 5, 1e-13
#: Share by which contacts give way: of many solutions the core takes the one that they have then.
SOFTNESS = 1e-6
#: Singular values below which changes are held by the softness.
HELD = 10.0 * SOFTNESS
#: How often they are solved again from there, without it.
AGAIN = 4
#: How much of a residual the solution may hold of before it counts as one of many.
UNIQUE = 1e7
#: How far friction may be from its bound, as a share of it, and slip as well as stick; over the largest impulse, how far
#: a contact may be from pressing, and press as well as open. What is at rest there tells of neither.
EDGE = 1e-6


#: From how many places a second solution is looked for, and how far it is from the first one over the largest impulse.
PLACES, APART = 12, 1e-4


Causes = Iterable[tuple[Bool, str]]


class Compression(NamedTuple):
    """Of each row of the table, not a number where nothing is known."""

    normal: F64
    """(K,) impulse, N s."""
    sliding: F64
    """(K, 3)."""
    gain: F64
    """(K,) largest change of an impulse over that of the residual."""
    first: I64
    """(K,) number of the first row of its contact in the step."""
    unknown: Array
    """(K,) why nothing is known, in words; "" where it is, or where nothing was compressed."""


def of_rows(
    run: Run,
    r: Hits,
    group: I64,
    lever: F64,
    motion: tuple[F64, F64],
    mu: F64,
    causes: Causes,
    doubted: Bool,
    known: Compression | None,
) -> Compression:
    """`lever` (K, 3) of the rows, `motion` their normal and slip velocities before the step; `causes` why nothing is
    known of groups with some rows (K,). In groups with `doubted` rows (K,) nothing is known either where another solution
    is found (`_several`); all others are as `known`, if they are.
    """
    many, index = len(run.names), run.law_index(r.a, r.b)
    _, first, contact = np.unique((r.k * many + r.a) * many + r.b, return_index=True, return_inverse=True)
    turns = run.coefficient("rolling_radius", index) + run.coefficient("spinning_radius", index) > 0.0
    approach, slip = motion
    normal, sliding, gain = (np.full(shape, np.nan) for shape in (len(r), (len(r), 3), len(r)))
    unknown = np.full(len(r), "", dtype=object)
    asked = r.problem > 0
    if known is not None:
        normal, sliding, gain, unknown = (of.copy() for of in (known[0], known[1], known[2], known[4]))
        asked = asked & doubted
    for g in np.unique(group[asked]):
        rows = first[group[first] == g]
        mine = (
            (np.array(len(rows) > MOST), f"groups of more than {MOST} contacts"),
            (turns[rows], "groups with rolling or spinning bounds"),
            *((given[rows], cause) for given, cause in causes),
        )
        unknown[rows] = next((cause for so, cause in mine if so.any()), "")
        if unknown[rows[0]]:
            continue
        ways, gradient, inverse = _rows(run, r.of(rows), lever[rows])
        across = ways[:, 1:]
        z = np.column_stack([approach[rows], np.einsum("ktx,kx->kt", across, slip[rows])])
        # Of several solutions that near to what the first problem had, which differs by the loads.
        begin = np.einsum("kwx,kx->kw", ways, _given(r, contact, rows, 1))
        stated = (gradient * inverse) @ gradient.T, z.ravel(), mu[rows]
        solved = solve(*stated, begin)
        if solved is not None and doubted[rows].any():
            given = np.einsum("kwx,kx->kw", ways, _given(r, contact, rows, 2))
            e = run.restitution(index[rows], solved[0][:, 0] * np.diag(stated[0])[::3])
            told = np.divide(given, e[:, None], out=np.zeros_like(given), where=e[:, None] > 0.0)
            solved = None if _several(stated, solved[0], told) else solved
        if solved is None:
            unknown[rows] = "groups whose impulses of compression are not unique, or were not found"
            normal[rows] = sliding[rows] = gain[rows] = np.nan
        else:
            normal[rows], gain[rows] = solved[0][:, 0], solved[1]
            sliding[rows] = np.einsum("kt,ktx->kx", solved[0][:, 1:], across)
    each = first[contact]
    return Compression(normal[each], sliding[each], gain[each], each, unknown[each])


def _rows(run: Run, r: Hits, lever: F64) -> tuple[F64, F64, F64]:
    """Directions (n, 3, 3) of the rows of contacts, their gradients (3n, 6m) by the velocities of m balls, 1/M."""
    bodies = np.unique(np.concatenate([r.a, r.b[r.b < run.bodies]]))
    axis = np.eye(3)[np.argmin(np.abs(lever), axis=1)]
    t1 = np.cross(axis, lever)
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    ways = np.stack([r.normal, t1, np.cross(lever, t1)], axis=1)
    turns = np.cross(ways, lever[:, None])
    turns[:, 0] = 0.0
    gradient = np.zeros((len(r), 3, len(bodies), 6))
    for of, sign in ((r.a, 1.0), (r.b, -1.0)):
        rows = np.flatnonzero(of < run.bodies)
        at = np.searchsorted(bodies, of[rows])
        gradient[rows, :, at, :3] = sign * ways[rows]
        gradient[rows, :, at, 3:] = run.reach[of[rows], None, None] * turns[rows]
        guided = np.flatnonzero(run.is_free_wall(of))  # which move along their normals alone
        gradient[guided, 1:, np.searchsorted(bodies, of[guided])] = 0.0
    inverse = np.repeat(1.0 / np.stack([run.mass[bodies], run.inertia[bodies]], axis=1), 3, axis=1).ravel()
    return ways, gradient.reshape(3 * len(r), -1), inverse


def _given(r: Hits, contact: I64, rows: I64, problem: int) -> F64:
    """(n, 3) impulses in a problem of the contacts that begin with these rows."""
    found, mine = np.zeros((len(rows), 3)), np.flatnonzero(r.problem == problem)
    at = np.searchsorted(contact[rows], contact[mine])
    here = contact[rows][np.minimum(at, len(rows) - 1)] == contact[mine]
    found[at[here]] = r.impulse[mine[here]]
    return found


def solve(w: F64, q: F64, mu: F64, begin: F64) -> tuple[F64, float] | None:
    """Impulses (n, 3), looked for from `begin`, and the largest change of one over that of the residual, but for those that
    the softness holds; None: not found, or not unique.
    """
    give, soft = SOFTNESS * np.diag(w), w + SOFTNESS * np.diag(np.diag(w))
    r, left = begin.ravel(), q
    for _ in range(1 + AGAIN):
        found = _solved(soft, left, mu, r)
        if found is None:
            return None
        # From there, without what the softness has left.
        r, stated = found, left
        left = q - give * r
    return _unique(soft, stated, mu, r)


def _several(stated: tuple[F64, F64, F64], one: F64, told: F64) -> bool:
    """Whether a problem with friction, which is not convex, has a solution far from this `one`, or may have: looked for from
    what the expansion has `told`, from nothing and from anywhere, where most searches have to end at the `one`.
    """
    mu, size = stated[2], float(np.abs(one).max(initial=0.0))
    if not mu.any():
        return False
    rng, lost = np.random.default_rng(0), 0
    anywhere = (rng.uniform(-1.0, 1.0, one.shape) * 2.0 * size for _ in range(PLACES - 2))
    for begin in (told, np.zeros_like(one), *anywhere):
        found = solve(*stated, begin)
        if found is not None and np.abs(found[0][:, 0] - one[:, 0]).max() > APART * size:
            return True
        lost += found is None
        if 2 * lost > PLACES:
            return True
    return False


def _solved(w: F64, q: F64, mu: F64, begin: F64) -> F64 | None:
    """Impulses (3n,); None: not found."""
    n, step = len(mu), 1.0 / np.diag(w)
    r, scale = begin.copy(), float(np.abs(step * q).max(initial=0.0))
    for _ in range(ROUNDS):
        for i in np.tile(np.arange(n), SWEEPS):
            rows = slice(3 * i, 3 * i + 3)
            r[rows] = _projected(r[rows] - step[rows] * (w[rows] @ r + q[rows]), mu[i])
        residual, slope = _natural(w, q, mu, step, r)
        if np.abs(residual).max() <= SOLVED * scale:
            return r
        with suppress(np.linalg.LinAlgError):
            tried = r - np.linalg.solve(slope, residual)
            after = np.abs(_natural(w, q, mu, step, tried)[0]).max()
            if after <= SOLVED * scale:
                return tried
            if after < np.abs(residual).max():
                r = tried
    return None


def _unique(w: F64, q: F64, mu: F64, r: F64) -> tuple[F64, float] | None:
    """Impulses (n, 3) and the largest change of one over that of the residual; None: others are as near."""
    step = 1.0 / np.diag(w)
    slopes = [_natural(w, q, mu, step, r)[1]]
    # What is at rest on an edge of its law may give way to either side.
    for edge in (EDGE, -EDGE):
        slope = _natural(w, q, mu, step, r, edge)[1]
        if not np.array_equal(slope, slopes[0]):
            slopes.append(slope)
    changes = [np.linalg.svd(of, compute_uv=False) for of in slopes]
    if min(of[-1] for of in changes) * UNIQUE <= 1.0:
        return None
    return r.reshape(-1, 3), 1.0 / min(of[of > HELD].min() for of in changes)


def _projected(xi: F64, mu: float) -> F64:
    """Onto the half-line and the disc that goes with it."""
    normal = max(0.0, float(xi[0]))
    size = float(np.hypot(xi[1], xi[2]))
    share = min(1.0, mu * normal / size) if size > 0.0 else 0.0
    return np.array([normal, share * xi[1], share * xi[2]])


def _natural(w: F64, q: F64, mu: F64, step: F64, r: F64, edge: float = 0.0) -> tuple[F64, F64]:
    """`r - P(r - z/D)`, and its slope by `r`: where contacts press and stick that miss it by `edge`."""
    xi = r - step * (w @ r + q)
    moved = np.eye(len(r)) - step[:, None] * w
    residual, slope, off = r.copy(), np.eye(len(r)), edge * float(np.abs(r).max(initial=0.0))
    for i, m in enumerate(mu):
        rows, n, t = slice(3 * i, 3 * i + 3), 3 * i, slice(3 * i + 1, 3 * i + 3)
        residual[rows] -= _projected(xi[rows], float(m))
        if xi[n] <= -off:
            continue
        slope[n] -= moved[n]
        size = float(np.hypot(*xi[t]))
        if size <= m * ((1.0 + edge) * xi[n] + off):
            slope[t] -= moved[t]
        elif m > 0.0:
            way = xi[t] / size
            turned = (np.eye(2) - np.outer(way, way)) @ moved[t]
            slope[t] -= m * (np.outer(way, moved[n]) + xi[n] / size * turned)
    return residual, slope
