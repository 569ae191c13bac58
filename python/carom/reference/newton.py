"""Semi-smooth Newton on the saddle system, and what is tried when it does not converge.

The chain is that of rule R1: p, p x 0.5, p x 2, fifteen Gauss-Seidel sweeps and Newton from there. The
reference adds two links of its own, because it must not fail where the core succeeds: Newton with a large
proximal shift (slow, hard to upset) and Gauss-Seidel until Newton can take over. A problem that survives all
of that raises `NotConverged`.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .model import F64, Options
from .problem import ContactProblem, Evaluation


class NotConverged(RuntimeError):
    """No link of the chain solved a contact problem; `history` holds the residuals of the last attempt."""

    def __init__(self, what: str, history: list[float]) -> None:
        super().__init__(f"{what}: the contact problem was not solved, residual {history[-1]:.3e}")
        self.history = history


@dataclass
class Solution:
    """u (d,), admissible multipliers phi (m,), and how they were found."""

    u: F64
    multipliers: F64
    iterations: int
    history: list[float] = field(default_factory=list)
    """Weighted residual norm before each iteration and at convergence (eq. 44, in N s or N s^2)."""
    fallback: str = ""
    """Empty, or the link of the chain that solved it."""


def solve(problem: ContactProblem, u: F64, options: Options, what: str = "") -> Solution:
    """Solve from u (d,) and zero multipliers."""
    zero = np.zeros(problem.layout.rows)
    history: list[float] = []

    # name, sweeps before, factor of p, lasting shift, limit of iterations (0: that of the options)
    attempts = (
        ("", 0, 1.0, 0.0, 0),
        ("p x 0.5", 0, 0.5, 0.0, 0),
        ("p x 2", 0, 2.0, 0.0, 0),
        ("gauss-seidel 15", 15, 1.0, 0.0, 0),
        ("shift 0.1", 0, 1.0, 0.1, 400),
        ("gauss-seidel 300", 300, 1.0, 0.0, 0),
        ("gauss-seidel 3000", 3000, 1.0, 0.0, 0),
    )
    for name, sweeps, p_factor, shift, limit in attempts:
        history.clear()
        # an attempt may diverge; that is an answer, not an error
        with np.errstate(over="ignore", invalid="ignore"):
            start = gauss_seidel(problem, u, zero, sweeps)
            solution = newton(problem, *start, options, p_factor, history, shift, limit)
        if solution is not None:
            solution.fallback = name
            return solution
    raise NotConverged(what, history)


def newton(
    problem: ContactProblem,
    u: F64,
    multipliers: F64,
    options: Options,
    p_factor: float,
    history: list[float],
    shift: float = 0.0,
    limit: int = 0,
) -> Solution | None:
    """Iterate from u, lambda; None at the limit. `shift` is what the proximal shift does not fall below."""
    base, problem.p = problem.p, problem.layout.p * p_factor
    limit = limit or options.max_iterations
    try:
        at = problem.evaluate(u, multipliers)
        first = at.norm
        history.append(at.norm)
        for iteration in range(limit + 1):
            if _converged(problem, u, at, options):
                # one more step costs little and takes the residual from the tolerance to rounding
                if at.norm > 0.0:
                    du, dl = _step(problem, u, multipliers, at, first, 0.0)
                    better = problem.evaluate(u + du, multipliers + dl)
                    if better.norm < at.norm:
                        u, at = u + du, better
                return Solution(u, at.phi, iteration, list(history))
            if iteration == limit or not np.isfinite(at.norm):
                return None
            du, dl = _step(problem, u, multipliers, at, first, shift)
            u, multipliers = u + du, multipliers + dl
            at = problem.evaluate(u, multipliers)
            history.append(at.norm)
        return None
    finally:
        problem.p = base


def _converged(problem: ContactProblem, u: F64, at: Evaluation, options: Options) -> bool:
    if not at.norm <= options.tolerance * at.scale + problem.floor:
        return False
    return problem.closed_gap(u, at.phi) <= options.gap_tolerance


def _step(
    problem: ContactProblem, u: F64, multipliers: F64, at: Evaluation, first: float, shift: float
) -> tuple[F64, F64]:
    """One Newton direction: du (d,), d lambda (m,).

    Contacts in gap decouple (d lambda = -lambda) and are left out. The remaining system is made dimensionless
    with the square roots of mass and p. The shift of the multiplier block (rules R1, R11) is in the matrix
    only, so it changes the path, not the solution; it vanishes with the residual, down to a floor that keeps
    redundant contacts solvable.
    """
    lay, d = problem.layout, len(problem.layout.dofs)
    active = np.flatnonzero(np.diagonal(at.tangent)[lay.start][lay.owner] > 0.0)
    dl = -multipliers + 0.0
    dl[active] = 0.0
    keep = np.concatenate([np.arange(d), d + active])
    hessian = problem.hessian(u, at)
    # phi of an open contact is zero, so its multiplier change never enters the other rows
    matrix = hessian[np.ix_(keep, keep)]
    rhs = -np.concatenate([at.r_u, at.r_l])[keep]
    left = np.concatenate([1.0 / np.sqrt(lay.mass), 1.0 / np.sqrt(problem.p[active])])
    right = np.concatenate([1.0 / np.sqrt(lay.mass), np.sqrt(problem.p[active])])
    matrix = matrix * right * left[:, None]
    eps = max(shift, 1e-4 * min(1.0, at.norm / first) if first > 0.0 else 0.0, _floor(problem, at, active))
    diagonal = np.arange(d, len(keep))
    matrix[diagonal, diagonal] -= eps
    try:
        solution = np.linalg.solve(matrix, rhs * left) * right
    except np.linalg.LinAlgError:
        solution = np.linalg.lstsq(matrix, rhs * left)[0] * right
    dl[active] = solution[d:]
    return solution[:d], dl


def _floor(problem: ContactProblem, at: Evaluation, active: NDArray[np.intp]) -> float:
    """Smallest shift: where rows depend on each other, rounding in their null space is divided by it."""
    scaled = at.gradient[active] * np.sqrt(problem.p[active])[:, None] / np.sqrt(problem.layout.mass)
    if len(active) <= len(problem.layout.dofs) and len(active) > 0:
        smallest = float(np.linalg.svd(scaled, compute_uv=False)[-1])
    else:
        smallest = 0.0
    return 1e-5 if smallest < 1e-6 else 1e-9


def gauss_seidel(problem: ContactProblem, u: F64, multipliers: F64, sweeps: int) -> tuple[F64, F64]:
    """Projected Gauss-Seidel, block after block (N, T, R, S of each contact); exact for a single block."""
    lay = problem.layout
    u, multipliers = u.copy(), multipliers.copy()
    for _ in range(sweeps):
        largest = 0.0
        for number, e in enumerate(lay.elements):
            n = int(lay.start[number])
            blocks = [(slice(n, n + 1), -1.0)]
            blocks += [(lay.disc_rows(number, disc.start, disc.stop), disc.bound) for disc in e.discs]
            for rows, bound in blocks:
                z, gradient = problem.kinematics(u)
                new = multipliers[rows] - z[rows] * 2.0 * lay.p[rows]  # 1/D_cc = 2 p
                if bound < 0.0:
                    new = np.maximum(0.0, new)
                else:
                    length, radius = float(np.linalg.norm(new)), bound * multipliers[n]
                    if length > radius:
                        new = new * (radius / length)
                change = new - multipliers[rows]
                largest = max(largest, float(np.max(np.abs(change))))
                multipliers[rows] = new
                u += gradient[rows].T @ change / lay.mass
        if largest <= 1e-15 * float(np.max(np.abs(multipliers), initial=0.0)):
            break
    return u, multipliers
