"""What joints accelerate their bodies by, from places and speeds alone, and what the scheme makes of its change in a step.

With `u = M^(1/2) v`, rows `g = G M^(-1/2)` and loads `p`, joints add the least `e = g^T l` that keeps their rates:

    g (e + p) = c'' - G' v

In a closed loop that is near a dead point `e` is many times what the turns of bodies tell. Smooth motion has
`u' = e + p`, and `e.u = 0` at each time. A step takes `e` of earlier and later times `t + tau h` with weights, whose mean
is `t + h/2` and whose variance is `s2`; of the power of their sum the mean of the speeds at both ends tells. What that is
off, by the Taylor series of `e(tau).u(t)` about the middle, is of third order:

    h^3/2 ((1/4) e.(e' + p') - s2 (3 e.e' + 2 e'.p + e.p'))

Displacements are off by a share of `h^3 u''`, too, on which `p` works. All that is at most `h^3 (|e| + |p|) |e'|` times a
number of the scheme (`share`); what changes of loads do is in other bounds (`loads`). Beside the dead point of a four-bar
linkage the formula is exact to 0.3 %.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.formula import law
from carom.audit.loads import of_loads
from carom.audit.vectors import cross, dot, norm

#: Groups of more rows are not solved; theirs is the estimate of `corrections`.
ROWS = 120
#: Share of the largest compliance that keeps rows which repeat one another apart.
REPEATED = 1e-11


def share(run: Run) -> float:
    """The factor of `h^3 (|e| + |p|) |e'|`."""
    rho = float(run.options["spectral_radius"])
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma, beta = 0.5 - alpha_m + alpha_f, 0.25 * (1.0 - alpha_m + alpha_f) ** 2
    # The filters follow one another: means and variances add up, with the sign of the one that is inverted.
    variance = gamma * (1.0 - gamma) + alpha_f * (1.0 - alpha_f) - alpha_m * (1.0 - alpha_m)
    places = abs(0.5 * gamma - beta) + abs(0.5 * (alpha_m - alpha_f) + beta - 1.0 / 6.0)
    return 0.5 * (0.25 + 3.0 * variance) + places


def accelerations(block: Block, bodies: list[int], joints: list[dict[str, Any]]) -> tuple[F64, F64]:
    """`e` of a group of joined bodies at the first and at the second frames, (B, 6 n), m/s^2 sqrt(kg)."""
    run, none = block.run, np.zeros((block.count, 6 * len(bodies)))
    if sum(len(joint["rows"]) for joint in joints) > ROWS or run.in_clump[bodies].any():
        return none, none
    m, inertia = run.mass[bodies], run.inertia[bodies]
    inverse = np.repeat(np.stack([m, inertia], axis=1) ** -0.5, 3, axis=1).ravel()
    pulled = np.nan_to_num(of_loads(block).alone[:, bodies]) / block.dt[:, None, None]
    pulled[..., :3] += m[:, None] * run.falls[bodies] if run.free_walls else m[:, None] * run.gravity
    loads = pulled.reshape(block.count, -1) * inverse
    first, second = (_solved(block, bodies, joints, end, inverse, loads) for end in (0, 1))
    return first, second


def _solved(
    block: Block, bodies: list[int], joints: list[dict[str, Any]], end: int, inverse: F64, loads: F64
) -> F64:
    place = {body: k for k, body in enumerate(bodies)}
    rows, asked = [], []
    for joint in joints:
        for row in joint["rows"]:
            of_row, bends = _row(block, joint, row, end)
            gradient = np.zeros((block.count, len(bodies), 6))
            for body, part in of_row:
                gradient[:, place[body]] += part
            rows.append(gradient.reshape(block.count, -1) * inverse)
            asked.append(bends)
    g, b = np.stack(rows, axis=1), np.stack(asked, axis=1) - np.einsum("brk,bk->br", np.stack(rows, 1), loads)
    usable = np.isfinite(g).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
    g, b = np.where(usable[:, None, None], g, 0.0), np.where(usable[:, None], b, 0.0)
    size = np.sqrt(np.einsum("brk,brk->br", g, g))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    g, b = g * scale[:, :, None], b * scale
    compliance = g @ g.transpose(0, 2, 1) + REPEATED * np.eye(g.shape[1])
    return np.asarray(np.einsum("brk,br->bk", g, np.linalg.solve(compliance, b[..., None])[..., 0]))


def _row(
    block: Block, joint: dict[str, Any], row: tuple[Any, ...], end: int
) -> tuple[list[tuple[int, F64]], F64]:
    """The gradient of a row for each of its bodies, (B, 6), and what the accelerations of both must make along it, (B,)."""
    kind, direction, arm_a, arm_b, form = row
    bends = (law(form, block.t1, before=True)[1] - law(form, block.t0)[1]) / block.dt
    along = np.broadcast_to(np.asarray(direction, dtype=np.float64), (block.count, 3))
    spins = block.w1 if end else block.w0
    sides = [
        (joint[side], sign, block.point(joint[side], arm, end))
        for side, sign, arm in (("a", 1.0, arm_a), ("b", -1.0, arm_b))
    ]
    if kind == "distance":
        apart = sides[0][2].place - sides[1][2].place
        rate = sides[0][2].velocity - sides[1][2].velocity
        length = np.maximum(norm(apart), 1e-300)
        along = apart / length[:, None]
        bends = bends - (dot(rate, rate) - dot(rate, along) ** 2) / length
    found = []
    for body, sign, point in sides:
        if body < 0:
            continue
        if kind == "rotation":
            found.append((body, sign * np.hstack([np.zeros_like(along), along])))
            continue
        w = spins[:, body]
        bends = bends - sign * dot(along, cross(w, cross(w, point.lever)))
        found.append((body, sign * np.hstack([along, cross(point.lever, along)])))
    return found, bends
