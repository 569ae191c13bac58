"""The local form of a contact problem: one group of rows for each contact, bodies eliminated.

Find r with

    u = W r + q,     K* contains  u + (sum_b mu_b |u_b|) n  perpendicular to  r in K

for every contact; K and its bounds mu_b are those of `carom.problem.cone`. At velocity level r is an impulse
and u a velocity (with what restitution adds in q), at position level a multiplier and a displacement: both are
the conditions of section 4 of docs/theory/algorithm.md with `lambda = r`, `z = u`.

| d, rows of a contact | order | bounds |
|---|---|---|
| 2 | N, T | mu |
| 3 | N, T1, T2 | mu |
| 5 | N, T1, T2, R1, R2 | mu, mu_r |
| 6 | N, T1, T2, R1, R2, S | mu, mu_r, mu_s |
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.problem.cone import BLOCKS
from carom.problem.errors import ContactProblemWarning, refuse
from carom.problem.given import finite, vector
from carom.problem.matrix import Csr, asymmetry, blocks, components

#: Relative asymmetry of W or M (largest entry of the difference over the largest of all): above the first it is
#: told, above the second refused. Published problems, written with few digits, reach 1e-3.
ASYMMETRY_TOLD, ASYMMETRY_REFUSED = 1e-8, 1e-2
#: Rows of a block of W, or of M, that is looked at when a problem is made (0.1 s): whether W is positive semidefinite, M
#: singular. Larger: problems that are only read and written take long.
MAX_CHECKED = 1000


@dataclass(frozen=True, eq=False, kw_only=True)
class Bounds:
    """What the local and the global form share: contacts, their bounds, and what the problem is called.

    `mu` (C,) is the coefficient of friction; `mu_r` and `mu_s` (C,) bound the rolling and the spinning moment
    over the normal component, in m. `dimension` is the number d of rows of a contact; 0 lets it follow from the
    arrays. There is no known solution: files have a place for one, but what stands there need not be one.
    """

    mu: F64
    mu_r: F64 | None = None
    mu_s: F64 | None = None
    dimension: int = 0
    title: str = ""
    description: str = ""
    math_info: str = ""

    @property
    def contacts(self) -> int:
        """Number of contacts C."""
        return len(self.mu)

    @property
    def rows(self) -> int:
        """Number of rows d C of the local form."""
        return self.contacts * self.dimension

    @property
    def bounds(self) -> F64:
        """(C, B) bounds of the blocks of a contact: mu, then mu_r and mu_s where they are."""
        return np.stack([b for b in (self.mu, self.mu_r, self.mu_s) if b is not None], axis=1)

    def _check_bounds(self, rows: int, name: str) -> None:
        """Check bounds and dimension against the `rows` rows of the vector `name`."""
        if self.mu is None:
            raise refuse("mu", "there is none", "give a number for each contact, 0 without friction")
        for key in ("mu", "mu_r", "mu_s"):
            if getattr(self, key) is not None:
                self._set(key, vector(getattr(self, key), key, len(np.atleast_1d(self.mu))))
                below = getattr(self, key) < 0.0
                if below.any():
                    c = int(np.argmax(below))
                    value = f"{getattr(self, key)[c]:g}"
                    raise refuse(key, f"{value} at contact {c} (from 0)", "bounds are 0 or positive")
        c = self.contacts
        if c == 0 and rows == 0:
            d = self.dimension or {(False, False): 3, (True, False): 5}.get(self._extra, 6)
        elif c == 0 or rows % c:
            raise refuse(name, f"{rows} rows for {c} contacts", "every contact has the same number of rows")
        else:
            d = rows // c
        if self.dimension not in (0, d):
            raise refuse(
                name, f"{d} rows for each contact, where {self.dimension} were announced", "mend either"
            )
        if d not in BLOCKS:
            cause = f"{rows} rows for {c} contacts, {d} each"
            raise refuse(name, cause, f"contacts have {', '.join(map(str, BLOCKS))} rows")
        wanted = {2: (False, False), 3: (False, False), 5: (True, False), 6: (True, True)}[d]
        if self._extra != wanted:
            given = [key for key, there in zip(("mu_r", "mu_s"), self._extra, strict=True) if there]
            needed = [key for key, there in zip(("mu_r", "mu_s"), wanted, strict=True) if there]
            cause = f"{d} rows for each contact, given {' and '.join(['mu', *given])}"
            raise refuse(name, cause, f"such contacts have {' and '.join(['mu', *needed])}")
        self._set("dimension", d)

    @property
    def _extra(self) -> tuple[bool, bool]:
        return self.mu_r is not None, self.mu_s is not None

    def _set(self, key: str, value: Any) -> None:
        object.__setattr__(self, key, value)


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalProblem(Bounds):
    """A contact problem `u = W r + q`, checked.

    `W` (d C, d C) may be dense, a SciPy sparse matrix or a `Csr`, which it becomes; `q` (d C,).
    """

    W: Csr
    q: F64
    max_asymmetry: float = ASYMMETRY_REFUSED
    """Largest entry of W - W^T over the largest of W above which W is refused."""

    def __post_init__(self) -> None:
        self._set("q", vector(self.q, "q"))
        self._check_bounds(len(self.q), "q")
        self._set("W", square(self.W, "W", len(self.q), self.max_asymmetry))
        positive(self.W, "W")
        _tell_indefinite(self.W)


def positive(matrix: Csr, name: str) -> None:
    """Refuse a negative diagonal, but for rounding."""
    diagonal = matrix.diagonal()
    if len(diagonal) and diagonal.min() < -ASYMMETRY_TOLD * float(np.abs(matrix.data).max(initial=0.0)):
        k = int(np.argmin(diagonal))
        cause = f"{diagonal[k]:g} on its diagonal, row {k} (from 0)"
        raise refuse(
            name, cause, "it must be positive semidefinite; is a sign in it, or in what made it, wrong?"
        )


def _tell_indefinite(w: Csr) -> None:
    """Warn of a W with negative eigenvalues, beyond what few digits and asymmetry make of 0."""
    block = components(w)
    if np.bincount(block).max(initial=0) > MAX_CHECKED:
        return
    rounding = max(ASYMMETRY_TOLD, asymmetry(w))
    for _, dense in blocks(w.symmetric, block):
        size, largest = dense.shape[1], np.abs(dense).max(axis=(1, 2))
        least = size * rounding * np.where(largest > 0.0, largest, 1.0)
        try:
            np.linalg.cholesky(dense + least[:, None, None] * np.eye(size))
        except np.linalg.LinAlgError:
            text = "W is not positive semidefinite: there may be no solution, or forces that no bodies have"
            warnings.warn(text, ContactProblemWarning, stacklevel=4)
            return


def square(matrix: Any, name: str, size: int, limit: float = ASYMMETRY_REFUSED) -> Csr:
    """A matrix of `size` rows and columns, finite and not far from symmetric."""
    csr = Csr.from_any(matrix, name)
    if csr.shape != (size, size):
        raise refuse(name, f"it is {csr.shape[0]} x {csr.shape[1]}", f"it must be {size} x {size}")
    finite(csr.data, name)
    skew = asymmetry(csr)
    if skew > limit:
        cause = f"unsymmetric by {skew:.2g} of its largest entry"
        raise refuse(name, cause, f"up to {limit:g} is taken for rounding")
    if skew > ASYMMETRY_TOLD:
        text = f"{name} is unsymmetric by {skew:.2g} of its largest entry; it is used as it stands"
        warnings.warn(text, ContactProblemWarning, stacklevel=4)
    return csr
