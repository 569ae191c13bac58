"""Impact through stiff Hertz springs (laws `compliant` and `binary`, section 5 of the specification).

The unit of stiffness is free; `k` goes with the square root of the radius of both curvatures. One step is half a drift of
the compressions, a kick with implicit friction, half a drift.
"""

import numpy as np

from .island import SPRINGS, Island
from .model import F64

RESOLUTION, LEAST_RESOLUTION = 500.0, 30.0
CLOSING = 1e-8
SWEEPS, SETTLED = 100, 1e-13


def on_disc(block: F64, free: F64, radius: float, still: float) -> F64:
    """The l of at most `radius` with the least `l . block l / 2 + free . l`, by bisection for its multiplier. Along an axis
    that joints hold, a slip of at most `still` is rounding.
    """
    own, axes = np.linalg.eigh(block)
    held = own <= 1e-9 * own[-1]
    along = np.where(held & (np.abs(free @ axes) <= still), 0.0, -(free @ axes))
    own = np.where(held & (along == 0.0), own[-1], np.maximum(own, 1e-14 * own[-1]))
    low, high = 0.0, float(np.hypot(*along)) / radius
    if np.hypot(*(along / own)) <= radius:
        high = 0.0
    while high - low > 1e-15 * (own[-1] + high):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.hypot(*(along / (own + middle))) > radius else (low, middle)
    found: F64 = axes @ (along / (own + high))
    return found


def spring_impulses(island: Island) -> F64:
    """Impulses (m,) from the velocities before the step; of contacts, which joints answer."""
    lay, gaps = island.layout, island.model.options.impact != "binary"
    coupling, z = island.reduced()
    inverse = np.diag(coupling)
    start = list(lay.start)
    radii = island.model.radius
    restitution = [1.0] * len(start)
    stiffness = [
        e.pair.law.stiffness_ratio
        * float(1.0 / radii[e.pair.a] + (1.0 / radii[e.pair.b] if e.pair.plane < 0 else 0.0)) ** -0.5
        for e in island.elements
    ]
    p = SPRINGS[island.model.options.impact] or island.model.options.impact_exponent
    impulses = np.zeros(lay.rows)
    depth, top = [0.0] * len(start), [0.0] * len(start)
    least = CLOSING * max(0.0, *(-z[n] for n in start))

    def drift(dt: float) -> None:
        for i, n in enumerate(start):
            v, d = float(z[n]), depth[i]
            if v <= 0.0 or d <= 0.0:
                work = 2.0 / (p + 1.0) * inverse[n] * stiffness[i] * max(0.0, d) ** (p + 1.0)
                restitution[i] = island.elements[i].pair.law.rebound(work**0.5)
            e = restitution[i]
            if d > 0.0 and v > 0.0:
                left = dt - d * e * e / v
                depth[i] = -v * left if left >= 0.0 else d - v / (e * e) * dt
            else:
                depth[i] = d - v * dt
            if not gaps:
                depth[i] = max(0.0, depth[i])

    def kick(dt: float) -> None:
        given = np.zeros(lay.rows)
        for i, n in enumerate(start):
            given[n] = stiffness[i] * max(0.0, depth[i]) ** p * dt
        z[:] += coupling @ given
        most = float(np.max(given))
        for _ in range(SWEEPS):
            change = 0.0
            for i, n in enumerate(start):
                e = island.elements[i]
                bound = e.discs[0].bound if e.slides else 0.0
                rows = slice(n + 1, n + 3)
                block = coupling[rows, rows]
                if bound * given[n] <= 0.0 or np.trace(block) <= 1e-12 * inverse[n]:
                    continue
                wanted = on_disc(block, z[rows] - block @ given[rows], bound * given[n], least)
                step = wanted - given[rows]
                given[rows] = wanted
                z[:] += coupling[:, rows] @ step
                change = max(change, float(np.hypot(*step)))
            if change <= SETTLED * most:
                break
        impulses[:] += given

    while True:
        steps = []
        for i, n in enumerate(start):
            wk = inverse[n] * stiffness[i]
            squared = z[n] ** 2 + 2.0 / (p + 1.0) * wk * max(0.0, depth[i]) ** (p + 1.0)
            if squared > least**2 and (depth[i] > 0.0 or z[n] < 0.0):
                # the error of a step goes with the speed, so fewer do where that of a contact has died out
                top[i] = max(top[i], float(squared))
                unit = wk ** (-1.0 / (p + 1.0)) * squared ** (0.5 * (1.0 - p) / (p + 1.0))
                steps.append(unit / max(LEAST_RESOLUTION, RESOLUTION * (squared / top[i]) ** 0.25))
        if not steps:
            return impulses
        dt = min(steps)
        if max(depth) <= 0.0:
            drift(min(depth[i] / z[n] for i, n in enumerate(start) if z[n] < -least))
        drift(0.5 * dt)
        kick(dt)
        drift(0.5 * dt)
