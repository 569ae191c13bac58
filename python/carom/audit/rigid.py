"""Clumps: rigid bodies of balls. Their balls are bodies of the auditor; mass and inertia are the clump's own.

    x_i = x + d_i,  v_i = v + w x d_i,  w_i = w,    d_i = R c_i,    L = J w,  J = R diag(J_1, J_2, J_3) R^T

Where bounds ask how far an impulse at most moves a ball of a clump, the ball has the least mass and moment of inertia that
an impulse meets anywhere on the clump: `1/m = 1/M + D^2/J_min`, `r/I = D/J_min`, with the reach `D` of the clump.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, I64, Bool
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
class Clumps:
    """All of a run, as its model gives them: C clumps of n balls together, among N bodies."""

    many: I64
    """(C,) how many balls each has."""
    balls: I64
    """(n,) numbers of their balls, those of one clump after the other."""
    mass: F64
    """(C,) kg."""
    inertia: F64
    """(C, 3) principal moments, kg m^2."""
    offsets: F64
    """(N, 3) centres of balls from the centre of mass, in the principal axes, m; 0 of other bodies."""
    turned: F64
    """(n, 4) orientations of balls in the principal axes."""
    reach: F64
    """(C,) largest distance of the surface from the centre of mass, m."""
    start: F64
    """(C, 13) the first row of `frames/clumps`."""

    def __len__(self) -> int:
        return len(self.mass)

    @cached_property
    def starts(self) -> I64:
        """(C,) where the balls of each begin among `balls`."""
        return np.asarray(np.cumsum(self.many) - self.many)

    @cached_property
    def of(self) -> I64:
        """(n,) the clump of each ball."""
        return np.repeat(np.arange(len(self)), self.many)

    @cached_property
    def first(self) -> I64:
        """(C,) the first ball of each, which stands for it."""
        return np.asarray(self.balls[self.starts])

    @cached_property
    def least(self) -> F64:
        """(C,) least moments of inertia."""
        return np.asarray(self.inertia.min(axis=1))

    @cached_property
    def most(self) -> F64:
        """(C,) largest moments of inertia."""
        return np.asarray(self.inertia.max(axis=1))

    @cached_property
    def arm(self) -> F64:
        """(n,) distances of balls from the centres of mass, m."""
        return norm(self.offsets[self.balls])

    def over(self, function: np.ufunc, values: F64 | Bool) -> Any:
        """(B, C, ...) sums, maxima, ... of `values` (B, N, ...) over the balls of each."""
        return function.reduceat(values[:, self.balls], self.starts, axis=1)

    def sum(self, values: F64) -> F64:
        """(B, C, ...) sums of `values` (B, N, ...) over the balls of each."""
        return np.asarray(self.over(np.add, values))

    def share(self, function: np.ufunc, values: F64 | Bool) -> None:
        """Lets all balls of each have the sum, the maximum, ... of their `values` (B, N, ...)."""
        values[:, self.balls] = self.over(function, values)[:, self.of]

    def levers(self, rows: F64) -> F64:
        """Centres of balls from the centres of mass, (..., n, 3), for rows (..., C, 13)."""
        return rotated(rows[..., self.of, 3:7], self.offsets[self.balls])

    def momentum(self, q: F64, w: F64, which: I64 | None = None) -> F64:
        """Angular momenta (..., C, 3) of orientations and angular velocities, N m s; or (K, 3) of `which` clumps (K,)."""
        return rotated(q, self._inertia(which) * rotated(conjugate(q), w))

    def turning(self, q: F64, momentum: F64, which: I64 | None = None) -> F64:
        """Angular velocities (..., C, 3) of orientations and angular momenta, rad/s; or (K, 3) of `which` clumps (K,)."""
        return rotated(q, rotated(conjugate(q), momentum) / self._inertia(which))

    def _inertia(self, which: I64 | None) -> F64:
        return self.inertia if which is None else self.inertia[which]

    def momenta(self, rows: F64) -> F64:
        """Angular momenta (..., C, 3) of rows (..., C, 13), N m s."""
        return self.momentum(rows[..., 3:7], rows[..., 10:])

    def energy(self, rows: F64) -> F64:
        """Kinetic energies (..., C) of rows (..., C, 13), J."""
        v, w = rows[..., 7:10], rows[..., 10:]
        return np.asarray(0.5 * (self.mass * dot(v, v) + dot(w, self.momenta(rows))))

    def balls_of(self, number: I64) -> tuple[I64, I64]:
        """All balls of clumps (K,), and which of the K each belongs to: the latter first."""
        count = self.many[number]
        each = np.repeat(np.arange(len(number)), count)
        within = np.arange(len(each)) - np.repeat(np.cumsum(count) - count, count)
        return each, self.balls[self.starts[number][each] + within]


def scheme(spin: F64, h: float) -> F64:
    """Angles by which the scheme may be off in the turn of a step `h`, rad, at angular speeds `spin`, rad/s."""
    return np.asarray(SCHEME * np.minimum(spin * h, 1.0) ** 7)


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


def of_model(model: Mapping[str, Any], bodies: int) -> Clumps:
    """Those of a model, of a run with so many bodies."""
    given = model.get("clumps", ())

    def column(name: str, width: int) -> F64:
        return np.array([one[name] for one in given], dtype=np.float64).reshape(-1, width)

    many = np.array([np.ptp(one["balls"]) for one in given], dtype=np.int64)
    balls = np.array([ball for one in given for ball in range(*one["balls"])], dtype=np.int64)
    of = np.repeat(np.arange(len(many)), many)
    x, q = column("position", 3), column("orientation", 4)
    q = q / norm(q)[:, None]
    back = conjugate(q)[of]
    at, radius = (np.asarray(model[name], dtype=np.float64)[balls] for name in ("position", "radius"))
    offsets = np.zeros((bodies, 3))
    offsets[balls] = rotated(back, at - x[of])
    turned = product(back, np.asarray(model["orientation"], dtype=np.float64)[balls])
    reach = np.zeros(len(many))
    np.maximum.at(reach, of, norm(offsets[balls]) + radius)
    start = np.hstack([x, q, column("velocity", 3), column("angular_velocity", 3)])
    return Clumps(many, balls, column("mass", 1)[:, 0], column("inertia", 3), offsets, turned, reach, start)


def lightest(clumps: Clumps, radius: F64, mass: F64, inertia: F64) -> tuple[F64, F64]:
    """Masses and moments of inertia (N,) with those of balls of clumps that bounds ask for."""
    mass, inertia, of = mass.copy(), inertia.copy(), clumps.of
    mass[clumps.balls] = (1.0 / (1.0 / clumps.mass + clumps.reach**2 / clumps.least))[of]
    inertia[clumps.balls] = clumps.least[of] * radius[clumps.balls] / clumps.reach[of]
    return mass, inertia


def kinetic(run: Run, v: F64, w: F64, rows: F64) -> F64:
    """(..., N) kinetic energy of each body, J: that of a clump is its first ball's. `rows` are (..., C, 13)."""
    return _of_bodies(
        run.clumps, 0.5 * (run.mass * dot(v, v) + run.inertia * dot(w, w)), run.clumps.energy(rows)
    )


def weight(run: Run, x: F64, rows: F64) -> F64:
    """(..., N) `m g x` of each body, J: that of a clump is its first ball's."""
    return _of_bodies(
        run.clumps, run.mass * dot(x, run.falls), run.clumps.mass * (rows[..., :3] @ run.gravity)
    )


def sizes(run: Run, x: F64, v: F64, w: F64, rows: F64) -> F64:
    """(..., N) sums of the absolute energies of each body, J."""
    height = dot(np.abs(x), np.abs(run.falls))
    alone = run.mass * (dot(v, v) + height) + run.inertia * dot(w, w)
    of_weight = run.clumps.mass * dot(np.abs(rows[..., :3]), np.abs(run.gravity))
    return _of_bodies(run.clumps, alone, 2.0 * run.clumps.energy(rows) + of_weight)


def _of_bodies(clumps: Clumps, alone: F64, of_clumps: F64) -> F64:
    """(..., N) what bodies have `alone`, and clumps (..., C) at their first balls."""
    found = np.asarray(alone)
    found[..., clumps.balls] = 0.0
    found[..., clumps.first] = of_clumps
    return found


def turned_energy(clumps: Clumps, old: F64, new: F64) -> F64:
    """(..., C) by how much the energy of turning with the angular momentum of rows `old` (..., C, 13) changes to the
    orientations of rows `new`, J: loads turn a clump while its angular momentum stays.
    """
    momentum = clumps.momenta(old)
    ends = [dot(momentum, clumps.turning(rows[..., 3:7], momentum)) for rows in (old, new)]
    return np.asarray(0.5 * (ends[1] - ends[0]))


def placed(run: Run, x: F64, q: F64, rows: F64) -> tuple[F64, F64, F64, F64]:
    """Places, orientations, velocities and angular velocities (..., N, ...) that balls of clumps have by rows (..., C, 13),
    in copies of those of all bodies, whose velocities are not looked at.
    """
    x, q = x.copy(), q.copy()
    v, w = np.zeros_like(x), np.zeros_like(x)
    clumps = run.clumps
    lever, of_each, balls = clumps.levers(rows), rows[..., clumps.of, :], clumps.balls
    x[..., balls, :] = of_each[..., :3] + lever
    q[..., balls, :] = product(of_each[..., 3:7], clumps.turned)
    v[..., balls, :] = of_each[..., 7:10] + cross(of_each[..., 10:], lever)
    w[..., balls, :] = of_each[..., 10:]
    return x, q, v, w
