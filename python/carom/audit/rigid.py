"""Clumps: rigid bodies of balls. Their balls are bodies of the auditor; mass and inertia are the clump's own.

    x_i = x + d_i,  v_i = v + w x d_i,  w_i = w,    d_i = R c_i,    L = J w,  J = R diag(J_1, J_2, J_3) R^T

Where bounds ask how far an impulse at most moves a ball of a clump, the ball has the least mass and moment of inertia that
an impulse meets anywhere on the clump: `1/m = 1/M + D^2/J_min`, `r/I = D/J_min`, with the reach `D` of the clump.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.audit.vectors import conjugate, cross, dot, norm, product, rotated

if TYPE_CHECKING:
    from carom.audit.data import Run

ORDER = (2, 4, 6, 8, 10, 12)
"""Parts of the rows of the extrapolation (Gragg, Bulirsch and Stoer) that turns a free clump."""
TURN = 0.2
"""Turn of a free clump in one extrapolation, rad: with six rows its error is below a rounding."""
MOST = 1000.0
"""Turn between two frames, rad, beyond which a free flight is not followed."""
SCHEME = 0.2
"""Error of the turn of a free clump in a step of the scheme, over the seventh power of the turn; four times what is seen."""


@dataclass(frozen=True)
class Clump:
    """One of them, as the model gives it."""

    balls: I64
    """Numbers of its balls, (n,)."""
    mass: float
    inertia: F64
    """Principal moments, (3,), kg m^2."""
    offsets: F64
    """Centres of its balls from its centre of mass, (n, 3), in its principal axes, m."""
    turned: F64
    """Orientations of its balls in its principal axes, (n, 4)."""
    reach: float
    """Largest distance of its surface from its centre of mass, m."""
    start: F64
    """Its first row of `frames/clumps`, (13,)."""

    @property
    def first(self) -> int:
        """Number of its first ball, which stands for it."""
        return int(self.balls[0])

    def levers(self, row: F64) -> F64:
        """Centres of its balls from its centre of mass, (..., n, 3), for rows (..., 13)."""
        return rotated(row[..., None, 3:7], self.offsets)

    def momentum(self, q: F64, w: F64) -> F64:
        """Angular momenta (..., 3) of orientations and angular velocities, N m s."""
        return rotated(q, self.inertia * rotated(conjugate(q), w))

    def turning(self, q: F64, momentum: F64) -> F64:
        """Angular velocities (..., 3) of orientations and angular momenta, rad/s."""
        return rotated(q, rotated(conjugate(q), momentum) / self.inertia)

    def energy(self, row: F64) -> F64:
        """Kinetic energy (...,) of rows (..., 13), J."""
        v, w = row[..., 7:10], row[..., 10:13]
        return np.asarray(0.5 * (self.mass * dot(v, v) + dot(w, self.momentum(row[..., 3:7], w))))

    def scheme(self, w: F64, h: float) -> F64:
        """(K,) rad by which the scheme may be off in the turn of a step `h`, for angular velocities (K, 3)."""
        return np.asarray(SCHEME * np.minimum(norm(w) * h, 1.0) ** 7)


class Clumps(NamedTuple):
    """All of them, as arrays: C clumps, N bodies."""

    mass: F64
    """(C,)"""
    inertia: F64
    """(C, 3) principal moments."""
    first: I64
    """(C,) their first balls."""
    many: I64
    """(C,) how many balls they have."""
    offsets: F64
    """(N, 3) centres of balls in the principal axes of their clumps, m; 0 of other bodies."""

    def momentum(self, number: I64, q: F64, w: F64) -> F64:
        """Angular momenta (K, 3) of clumps (K,), N m s."""
        return rotated(q, self.inertia[number] * rotated(conjugate(q), w))

    def turning(self, number: I64, q: F64, momentum: F64) -> F64:
        """Angular velocities (K, 3) of clumps (K,), rad/s."""
        return rotated(q, rotated(conjugate(q), momentum) / self.inertia[number])

    def balls_of(self, number: I64) -> tuple[I64, I64]:
        """All balls of clumps (K,), and which of the K each belongs to: the latter first."""
        count = self.many[number]
        each = np.repeat(np.arange(len(number)), count)
        within = np.arange(len(each)) - np.repeat(np.cumsum(count) - count, count)
        return each, self.first[number][each] + within


def together(clumps: list[Clump], bodies: int) -> Clumps:
    """The arrays of all clumps of a run with so many bodies."""
    offsets = np.zeros((bodies, 3))
    for clump in clumps:
        offsets[clump.balls] = clump.offsets
    return Clumps(
        np.array([clump.mass for clump in clumps]),
        np.array([clump.inertia for clump in clumps]).reshape(-1, 3),
        np.array([clump.first for clump in clumps], dtype=np.int64),
        np.array([len(clump.balls) for clump in clumps], dtype=np.int64),
        offsets,
    )


def free(inertia: F64, q: F64, w: F64, h: F64) -> F64:
    """Orientations (K, 4) to which bodies of principal moments (K, 3) turn without moments of force in times (K,), s; not a
    number where they turn by more than `MOST`.
    """
    momentum = rotated(q, inertia * rotated(conjugate(q), w))
    turn = norm(momentum) / inertia.min(axis=-1, initial=np.inf) * np.abs(h)
    with np.errstate(invalid="ignore"):
        parts = np.maximum(np.ceil(np.nan_to_num(np.minimum(turn, MOST)) / TURN), 1.0).astype(np.int64)
    found = q.copy()
    for count in np.unique(parts):
        rows = np.flatnonzero(parts == count)
        end, step = q[rows], h[rows] / count
        for _ in range(count):
            end = _extrapolated(inertia[rows], end, momentum[rows], step)
        found[rows] = end
    found[turn > MOST] = np.nan
    return found


def _extrapolated(inertia: F64, q: F64, momentum: F64, h: F64) -> F64:
    """A part of a free turn, from midpoint rules with several numbers of parts."""

    def rate(at: F64) -> F64:
        own = rotated(conjugate(at), momentum) / inertia
        return np.asarray(0.5 * product(at, np.concatenate([np.zeros((*own.shape[:-1], 1)), own], axis=-1)))

    table: list[list[F64]] = []
    for row, parts in enumerate(ORDER):
        step = (h / parts)[:, None]
        last, now = q, q + step * rate(q)
        for _ in range(parts - 1):
            last, now = now, last + 2.0 * step * rate(now)
        found = [0.5 * (last + now + step * rate(now))]
        for k in range(row):
            share = (parts / ORDER[row - k - 1]) ** 2 - 1.0
            found.append(found[k] + (found[k] - table[-1][k]) / share)
        table.append(found)
    end = table[-1][-1]
    return np.asarray(end / norm(end)[:, None])


def of_model(model: Mapping[str, Any]) -> list[Clump]:
    """Those of a model."""
    found = []
    for given in model.get("clumps", ()):
        balls = np.arange(*given["balls"], dtype=np.int64)
        x, q = (np.array(given[name], dtype=np.float64) for name in ("position", "orientation"))
        back = conjugate(q / norm(q))
        offsets = rotated(back, np.asarray(model["position"], dtype=np.float64)[balls] - x)
        turned = product(back, np.asarray(model["orientation"], dtype=np.float64)[balls])
        reach = norm(offsets) + np.asarray(model["radius"], dtype=np.float64)[balls]
        motion = [np.array(given[name], dtype=np.float64) for name in ("velocity", "angular_velocity")]
        start = np.concatenate([x, q / norm(q), *motion])
        inertia = np.array(given["inertia"], dtype=np.float64)
        found.append(Clump(balls, float(given["mass"]), inertia, offsets, turned, float(reach.max()), start))
    return found


def lightest(clumps: list[Clump], radius: F64, mass: F64, inertia: F64) -> tuple[F64, F64]:
    """Masses and moments of inertia (N,) with those of balls of clumps that bounds ask for."""
    mass, inertia = mass.copy(), inertia.copy()
    for clump in clumps:
        least, b = clump.inertia.min(), clump.balls
        mass[b] = 1.0 / (1.0 / clump.mass + clump.reach**2 / least)
        inertia[b] = least * radius[b] / clump.reach
    return mass, inertia


def kinetic(run: Run, v: F64, w: F64, rows: F64) -> F64:
    """(..., N) kinetic energy of each body, J: that of a clump is its first ball's. `rows` are (..., C, 13)."""
    found = np.asarray(0.5 * (run.mass * dot(v, v) + run.inertia * dot(w, w)))
    for number, clump in enumerate(run.clumps):
        found[..., clump.balls] = 0.0
        found[..., clump.first] = clump.energy(rows[..., number, :])
    return found


def weight(run: Run, x: F64, rows: F64) -> F64:
    """(..., N) `m g x` of each body, J: that of a clump is its first ball's."""
    found = np.asarray(run.mass * dot(x, run.falls))
    for number, clump in enumerate(run.clumps):
        found[..., clump.balls] = 0.0
        found[..., clump.first] = clump.mass * (rows[..., number, :3] @ run.gravity)
    return found


def sizes(run: Run, x: F64, v: F64, w: F64, rows: F64) -> F64:
    """(..., N) sums of the absolute energies of each body, J."""
    height = dot(np.abs(x), np.abs(run.falls))
    found = np.asarray(run.mass * (dot(v, v) + height) + run.inertia * dot(w, w))
    for number, clump in enumerate(run.clumps):
        row = rows[..., number, :]
        found[..., clump.balls] = 0.0
        of_weight = clump.mass * dot(np.abs(row[..., :3]), np.abs(run.gravity))
        found[..., clump.first] = 2.0 * clump.energy(row) + of_weight
    return found


def turned_energy(clump: Clump, old: F64, new: F64) -> F64:
    """(...,) by how much the energy of turning with the angular momentum of rows `old` (..., 13) changes to the orientations
    of rows `new`, J: loads turn a clump while its angular momentum stays.
    """
    momentum = clump.momentum(old[..., 3:7], old[..., 10:13])
    ends = [dot(momentum, clump.turning(row[..., 3:7], momentum)) for row in (old, new)]
    return np.asarray(0.5 * (ends[1] - ends[0]))


def placed(run: Run, x: F64, q: F64, rows: F64) -> tuple[F64, F64, F64, F64]:
    """Places, orientations, velocities and angular velocities (..., N, ...) that balls of clumps have by rows (..., C, 13),
    in copies of those of all bodies, whose velocities are not looked at.
    """
    x, q = x.copy(), q.copy()
    v, w = np.zeros_like(x), np.zeros_like(x)
    for number, clump in enumerate(run.clumps):
        row, b = rows[..., number, :], clump.balls
        lever = clump.levers(row)
        x[..., b, :] = row[..., None, :3] + lever
        q[..., b, :] = product(np.broadcast_to(row[..., None, 3:7], (*lever.shape[:-1], 4)), clump.turned)
        spin = np.broadcast_to(row[..., None, 10:13], lever.shape)
        v[..., b, :] = row[..., None, 7:10] + cross(spin, lever)
        w[..., b, :] = spin
    return x, q, v, w
