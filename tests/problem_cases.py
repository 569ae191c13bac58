"""Contact problems made at random, and those that others published, for tests."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carom.problem import GlobalProblem, LocalProblem, cone
from hypothesis import strategies as st

DIMENSIONS = [2, 3, 5, 6]

# The published problems lie beside the project, or where this variable says; they are not part of it.
PUBLISHED = Path(
    os.environ.get("CAROM_CONTACT_PROBLEMS", Path(__file__).parents[2] / "shared/data/contact_problems")
)
FILES = sorted(PUBLISHED.glob("*.hdf5"))
needs_published = pytest.mark.skipif(
    not FILES, reason="published contact problems are not there (CAROM_CONTACT_PROBLEMS names their folder)"
)


def numbers(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def bounds_of(rng: np.random.Generator, contacts: int, d: int) -> dict[str, np.ndarray]:
    """mu, mu_r, mu_s as contacts of d rows have them; some are 0."""
    names = ["mu", "mu_r", "mu_s"][: {2: 1, 3: 1, 5: 2, 6: 3}[d]]
    return {name: rng.uniform(0.0, 1.5, contacts) * (rng.random(contacts) < 0.9) for name in names}


def a_problem(seed: int, d: int = 3, contacts: int = 5, bodies: int = 3) -> GlobalProblem:
    """Bodies of 6 degrees of freedom, coupled mass matrices, random rows: W is singular for many contacts."""
    rng = numbers(seed)
    n = 6 * bodies
    m = np.zeros((n, n))
    for k in range(bodies):
        a = rng.normal(size=(6, 6))
        m[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = a @ a.T + 0.1 * np.eye(6)
    h = np.zeros((n, d * contacts))
    for c in range(contacts):
        for body in rng.choice(bodies, 2, replace=False) if bodies > 1 else [0]:
            h[6 * body : 6 * body + 6, d * c : d * c + d] = rng.normal(size=(6, d))
    vectors = {"f": rng.normal(size=n), "w": rng.normal(size=d * contacts)}
    return GlobalProblem(M=m, H=h, **vectors, **bounds_of(rng, contacts, d), title=f"seed {seed}")


# --- cones ------------------------------------------------------------------------------------------------------------

seeds = st.integers(0, 2**32 - 1)


# --- the residual -----------------------------------------------------------------------------------------------------


def one_ball(seed: int, d: int, contacts: int = 8) -> tuple[LocalProblem, np.ndarray]:
    """Contacts that do not touch one another, W diagonal as for spheres, and their solution by the law of discs."""
    rng = numbers(seed)
    own = rng.uniform(0.1, 10.0, (contacts, len(cone.BLOCKS[d]) + 1))
    q = rng.normal(size=(contacts, d)) * 10.0 ** rng.uniform(-3, 3)
    q[:2, 1:] = 0.0
    bounds = bounds_of(rng, contacts, d)
    r = np.zeros((contacts, d))
    r[:, 0] = np.maximum(0.0, -q[:, 0] / own[:, 0])
    diagonal = np.empty((contacts, d))
    diagonal[:, 0] = own[:, 0]
    for b, (block, bound) in enumerate(zip(cone.BLOCKS[d], bounds.values(), strict=True)):
        diagonal[:, block] = own[:, b + 1, None]
        stick = -q[:, block] / own[:, b + 1, None]
        length = np.linalg.norm(stick, axis=1)
        factor = np.minimum(1.0, bound * r[:, 0] / np.where(length > 0.0, length, 1.0))
        r[:, block] = stick * factor[:, None]
    problem = LocalProblem(W=np.diag(diagonal.reshape(-1)), q=q.reshape(-1), **bounds)
    return problem, r.reshape(-1)


GOOD: dict[str, Any] = {"W": np.eye(6), "q": np.ones(6), "mu": [0.1, 0.2]}
