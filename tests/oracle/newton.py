"""Semi-smooth Newton on the saddle system, and what is tried when it does not converge.

The chain is that of rule R1: p, p x 0.5, p x 2, fifteen Gauss-Seidel sweeps and Newton from there. The
reference adds links of its own, because it must not fail where the core succeeds: a line search, patience,
many sweeps. What is still unsolved then are redundant contacts whose multipliers would have to creep a long way
while velocities stand still to nine digits: the best iterate is taken, and named `loose`, if its residual is
below `LOOSE`; otherwise `NotConverged` is raised.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .model import F64, Options
from .problem import ContactProblem, Evaluation

LOOSE = 1e-7
"""Relative residual up to which the best of all iterates is better than no answer; it is always reported."""


class NotConverged(RuntimeError):
    """No link of the chain solved a contact problem; `history` holds the residuals of the last attempt."""

    def __init__(self, what: str, history: list[float]) -> None:
        super().__init__(
            f"{what}: the contact problem was not solved, residual {history[-1]:.1e} of {history[0]:.1e}"
        )
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
    converged: bool = False
    relative: float = np.inf
    """Residual over the sum of its contributions (eq. 44)."""


def solve(problem: ContactProblem, u: F64, options: Options, what: str = "") -> Solution:
    """Solve from u (d,) and zero multipliers."""
    zero = np.zeros(problem.layout.rows)
    history: list[float] = []

    # name, sweeps before, factor of p, line search, limit of iterations
    usual = options.max_iterations
    attempts = (
        ("", 0, 1.0, False, usual),
        ("p x 0.5", 0, 0.5, False, usual),
        ("p x 2", 0, 2.0, False, usual),
        ("gauss-seidel 15", 15, 1.0, False, usual),
        ("line search", 15, 1.0, True, usual),
        ("patience", 0, 1.0, False, 4 * usual),
        ("gauss-seidel 300", 300, 1.0, True, 2 * usual),
        ("gauss-seidel 3000", 3000, 1.0, False, usual),
    )
    best = Solution(u, zero, 0)
    for name, sweeps, p_factor, search, limit in attempts:
        if sweeps > 1000 and best.relative <= 1e-2 * LOOSE:
            break
        history.clear()
        # an attempt may diverge; that is an answer, not an error
        with np.errstate(over="ignore", invalid="ignore"):
            start = gauss_seidel(problem, u, zero, sweeps)
            solution = newton(problem, *start, options, p_factor, history, search, limit)
        if solution.converged:
            solution.fallback = name
            return solution
        if solution.relative < best.relative:
            best = solution
    if best.relative <= LOOSE:
        best.fallback = f"loose {best.relative:.1e}"
        return best
    raise NotConverged(what, best.history or history)


def newton(
    problem: ContactProblem,
    u: F64,
    multipliers: F64,
    options: Options,
    p_factor: float,
    history: list[float],
    search: bool,
    limit: int,
) -> Solution:
    """Iterate from u, lambda; at the limit the best iterate, not `converged`. `search` halves steps that gain nothing."""
    base, problem.p = problem.p, problem.layout.p * p_factor
    best = Solution(u, multipliers, 0)
    try:
        at = problem.evaluate(u, multipliers)
        first = at.norm
        for iteration in range(limit + 1):
            history.append(at.norm)
            if not np.isfinite(at.norm):
                break
            if _converged(problem, u, at, options):
                # one more step costs little and takes the residual from the tolerance to rounding
                if at.norm > 0.0:
                    du, dl = _step(problem, u, multipliers, at, first)
                    better = problem.evaluate(u + du, multipliers + dl)
                    if better.norm < at.norm:
                        u, at = u + du, better
                return Solution(u, at.phi, iteration, list(history), converged=True, relative=0.0)
            relative = at.norm / at.scale if at.scale > 0.0 else np.inf
            if relative < best.relative and problem.closed_gap(u, at.phi) <= 100.0 * options.gap_tolerance:
                best = Solution(u, at.phi, iteration, list(history), relative=relative)
            du, dl = _step(problem, u, multipliers, at, first)
            new = problem.evaluate(u + du, multipliers + dl)
            for _ in range(12 if search else 0):
                if new.norm < at.norm:
                    break
                du, dl = 0.5 * du, 0.5 * dl
                new = problem.evaluate(u + du, multipliers + dl)
            u, multipliers, at = u + du, multipliers + dl, new
        return best
    finally:
        problem.p = base


def _converged(problem: ContactProblem, u: F64, at: Evaluation, options: Options) -> bool:
    if not at.norm <= options.tolerance * at.scale + problem.floor:
        return False
    return problem.closed_gap(u, at.phi) <= options.gap_tolerance


def _step(problem: ContactProblem, u: F64, multipliers: F64, at: Evaluation, first: float) -> tuple[F64, F64]:
    """One Newton direction: du (d,), d lambda (m,).

    Contacts in gap decouple (d lambda = -lambda) and are left out. The remaining system is made dimensionless
    with the square roots of mass and p. The shift of the multiplier block (rules R1, R11) is in the matrix
    only, so it changes the path, not the solution; it vanishes with the residual, down to a floor that keeps
    redundant contacts solvable.
    """
    lay, d = problem.layout, len(problem.layout.dofs)
    pressed = (np.diagonal(at.tangent)[lay.start] > 0.0) | (problem.least > 0.0)
    closed = np.flatnonzero(pressed[lay.owner])
    active = np.concatenate([closed, np.arange(lay.contact_rows, lay.rows)])
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
    vanishing = 1e-4 * min(1.0, at.norm / first) if first > 0.0 else 0.0
    eps = max(vanishing, _floor(problem, at, active))
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
    """Projected Gauss-Seidel, block after block (N, T, R, S of each contact, rows of joints); exact for a single block."""
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
                    new = np.maximum(problem.least[number], new)
                else:
                    length, radius = float(np.linalg.norm(new)), bound * multipliers[n]
                    if length > radius:
                        new = new * (radius / length)
                change = new - multipliers[rows]
                largest = max(largest, float(np.max(np.abs(change))))
                multipliers[rows] = new
                acting = gradient if problem.along is None else problem.along
                u += acting[rows].T @ change / lay.mass
        for row in range(lay.contact_rows, lay.rows):
            z, gradient = problem.kinematics(u)
            change = -z[row] * 2.0 * lay.p[row]
            largest = max(largest, abs(float(change)))
            multipliers[row] += change
            u += gradient[row] * change / lay.mass
        if largest <= 1e-15 * float(np.max(np.abs(multipliers), initial=0.0)):
            break
    return u, multipliers
