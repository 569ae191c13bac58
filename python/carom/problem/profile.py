"""Performance profiles: which of several solvers to prefer, over many problems.

Dolan and Moré (2002), "Benchmarking optimization software with performance profiles": with t[p, s] the time that
solver s takes for problem p, infinite where it does not solve it, the ratio to the best of all solvers and the
share of problems that a solver solves within a factor tau of the best are

    rho[p, s] = t[p, s] / min_s t[p, s],        share_s(tau) = #{p : rho[p, s] <= tau} / #{p}.

share_s(1) is how often s is the fastest, and for large tau the share is that of the problems that s solves at all. A
problem that no solver solves counts against all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64
from carom.errors import CaromError


@dataclass(frozen=True, eq=False)
class Profile:
    """Times of several solvers for the same problems: `times` (problems, solvers), s, infinite where not solved."""

    solvers: tuple[str, ...]
    times: F64

    @classmethod
    def of(cls, solvers: Sequence[str], times: ArrayLike) -> Profile:
        """The profile of `times` (problems, solvers) > 0; NaN and infinity mean: not solved."""
        t = np.array(times, dtype=np.float64)
        if t.ndim != 2 or t.shape[1] != len(solvers):
            raise CaromError(f"a profile of {len(solvers)} solvers from times of shape {t.shape}")
        if (t <= 0.0).any():
            raise CaromError("a profile compares times above 0 s")
        t[np.isnan(t)] = np.inf
        t.setflags(write=False)
        return cls(tuple(solvers), t)

    @property
    def problems(self) -> int:
        """Number of problems, those that nobody solves included."""
        return len(self.times)

    @property
    def ratios(self) -> F64:
        """(problems, solvers) times over the best of the problem; infinite where not solved."""
        best = self.times.min(axis=1, initial=np.inf, keepdims=True)
        ratios = np.full_like(self.times, np.inf)
        np.divide(self.times, best, out=ratios, where=np.isfinite(self.times))
        return ratios

    def within(self, tau: float) -> F64:
        """(solvers,) share of the problems solved within the factor `tau` of the best."""
        return _share(self.ratios, tau)

    def curves(self) -> tuple[F64, F64]:
        """Factors (K,), from 1 on, where a share rises, and the shares (K, solvers) from there on."""
        return _curves(self.ratios, 1.0)

    def solved(self) -> tuple[F64, F64]:
        """Times (K,), s, where a share rises, and the shares (K, solvers) of the problems solved by then."""
        return _curves(self.times, None)


def _share(values: F64, limit: float) -> F64:
    share: F64 = np.count_nonzero(values <= limit, axis=0) / max(len(values), 1)
    return share


def _curves(values: F64, first: float | None) -> tuple[F64, F64]:
    at = np.unique(values[np.isfinite(values)])
    if first is not None:
        at = np.union1d(at, [first])
    return at, np.array([_share(values, x) for x in at]).reshape(len(at), values.shape[1])
