"""How well r solves a contact problem: one number for all solvers, computed outside of them.

The natural map of the problem, with u = W r + q and `shift` and `project` of `carom.problem.cone`,

    F(r) = r - P_K( r - (u + (sum_b mu_b |u_b|) n) )

is zero exactly at the solutions. Its norm over the largest of the three that occur is the residual:

    err = |F| / max(|q|, |r|, |u|).

Where all three vanish so does F, and err is 0. F adds impulses and
velocities as they stand, so err depends on the units: compare numbers of one problem only.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.problem import cone
from carom.problem.given import of_contacts
from carom.problem.local import LocalProblem


@dataclass(frozen=True)
class Residual:
    """What is left of the conditions at an r; the maxima are over contacts, units those of r and u."""

    err: float
    """|F| / max(|q|, |r|, |u|); infinite if r is not finite."""
    natural_map: float
    """|F|."""
    scale: float
    """max(|q|, |r|, |u|)."""
    worst: int
    """The contact (from 0) where |F| is largest; -1 if there is none."""
    worst_natural_map: float
    """|F| at this contact."""
    complementarity: float
    """Largest |r . (u + shift)|: power or work that the law forbids."""
    cone_violation: float
    """Largest of -r_N and |r_b| - mu_b r_N: how far r is outside of K."""
    penetration: float
    """Largest -u_N: how far the shifted u is outside of the dual cone."""

    def __float__(self) -> float:
        return self.err

    def to_dict(self) -> dict[str, Any]:
        """The fields, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        return (
            f"err = {self.err:.3g} (worst contact {self.worst}: {self.worst_natural_map:.3g}; complementarity"
            f" {self.complementarity:.3g}, outside the cone {self.cone_violation:.3g}, penetration {self.penetration:.3g})"
        )


def natural_map(problem: LocalProblem, r: F64, u: F64) -> F64:
    """(C, d) F(r) for `r` (d C,) and `u = W r + q` (d C,)."""
    force, velocity = (v.reshape(-1, problem.dimension) for v in (r, u))
    return force - cone.project(force - cone.shift(velocity, problem.bounds), problem.bounds)


def residual_of(problem: LocalProblem, r: Any) -> Residual:
    """The residual of `r` (d C,) or (C, d)."""
    r = of_contacts(r, "r", problem.contacts, problem.dimension)
    with np.errstate(over="ignore", invalid="ignore"):  # an r without bound is reported as infinite, below
        u = problem.W.dot(r) + problem.q
    if not (np.isfinite(r).all() and np.isfinite(u).all()):
        # Divisible by construction; a solver that gave up returns such an r.
        bad = ~np.isfinite(r + u).reshape(-1, problem.dimension).all(axis=1)
        inf = math.inf
        return Residual(inf, inf, inf, int(np.argmax(bad)), inf, inf, inf, inf)
    if problem.contacts == 0:
        return Residual(0.0, 0.0, 0.0, -1, 0.0, 0.0, 0.0, 0.0)
    # Bounds may be as large as numbers are: what overflows is no solution, and counts as infinitely wrong.
    with np.errstate(over="ignore", invalid="ignore"):
        return _judged(problem, r, u)


def _judged(problem: LocalProblem, r: F64, u: F64) -> Residual:
    """The residual of finite `r` and `u`, (d C,)."""
    force, velocity = (v.reshape(-1, problem.dimension) for v in (r, u))
    f = natural_map(problem, r, u)
    f[np.isnan(f)] = math.inf
    each = np.array([_norm(row) for row in f]) if len(f) < 64 else np.linalg.norm(f, axis=1)
    scale = max(_norm(problem.q), _norm(r), _norm(u))
    size = _norm(f)
    complementarity = np.abs(np.sum(force * cone.shift(velocity, problem.bounds), axis=1))
    return Residual(
        err=size / scale if scale > 0.0 else 0.0,
        natural_map=size,
        scale=scale,
        worst=int(np.argmax(each)),
        worst_natural_map=float(each.max()),
        complementarity=_largest(complementarity),
        cone_violation=_largest(cone.outside(force, problem.bounds)),
        penetration=max(0.0, float(-velocity[:, 0].min())),
    )


def _largest(v: F64) -> float:
    """The largest, infinite where one overflowed."""
    return float(np.where(np.isnan(v), math.inf, v).max())


#: Share of what approaches below which normal forces hold nothing. Solvers that ended early had 0.01 and more, but for
#: `gauss-seidel` on bodies of very unlike masses.
HOLDS_NOTHING = 0.01


def holds_nothing(problem: LocalProblem, r: F64, u: F64) -> bool:
    """Whether normal forces `r` work against one another alone, and nothing penetrates less than with `r = 0`.

    At a solution `r_N . (W r)_N = -q_N . r_N`, whatever the friction. Forces without friction whose left side is 0, and not
    the right one, are the proof that there is none (Farkas): they may grow without end. Here it is small,
    a sign and no proof: where masses are very unlike, slow convergence looks alike.
    """
    force, after, before = (v[:: problem.dimension] for v in (r, u, problem.q))
    with np.errstate(over="ignore", invalid="ignore"):
        asked, held = -float(force @ before), float(force @ (after - before))
        vain = asked > 0.0 and held < HOLDS_NOTHING * asked
        return bool(vain and after.min() <= (1.0 - HOLDS_NOTHING) * before.min())


def _norm(v: F64) -> float:
    """Euclidean norm that neither overflows nor underflows: 1e-200 over 1e-200 is 1."""
    largest = float(np.abs(v).max(initial=0.0))
    return largest * float(np.linalg.norm(v / largest)) if 0.0 < largest < math.inf else largest
