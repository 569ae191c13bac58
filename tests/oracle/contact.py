"""The contact element: gap, normal, rows and their derivative, for sphere on sphere and sphere on plane.

The rows of a contact act on the generalised vector of its own bodies, (6,) at a plane and (12,) between
spheres, A first. Order of the rows: N, then T (2), R (2), S (1) as far as the law of the pair has them.
"""

from dataclasses import dataclass

import numpy as np

from .model import F64, Model, Pair


@dataclass(frozen=True)
class Disc:
    """Rows `start : stop` of an element, bounded in length by `bound` times the normal multiplier."""

    kind: str
    """'T' sliding, 'R' rolling, 'S' spinning."""
    start: int
    stop: int
    bound: float
    """mu [-], rho [m] or delta [m]."""


@dataclass(frozen=True)
class Element:
    """A pair with its frame frozen at t_n; everything that does not change within the step.

    `rows` (k, 6 or 12): row 0 is the normal row with the normal of t_n, the others are those used at both
    levels (eq. 41 and its kin for rolling and spinning). `delassus` (k,): diagonal D_cc of G M^-1 G^T [1/kg
    or 1/(kg m^2)].
    """

    pair: Pair
    normal: F64
    tangents: F64
    rows: F64
    discs: tuple[Disc, ...]
    delassus: F64

    @property
    def slides(self) -> bool:
        """Whether there are sliding rows; they are rows 1 and 2 then."""
        return any(disc.kind == "T" for disc in self.discs)


def gap_and_normal(model: Model, pair: Pair, x: F64) -> tuple[float, F64, float]:
    """Gap [m], unit normal from B to A, and distance of the centres [m] (inf at a plane): eqs. 31 and 33.

    `x` (N,3) centres.
    """
    if pair.plane >= 0:
        normal = model.plane_normal[pair.plane]
        gap = float(normal @ (x[pair.a] - model.plane_point[pair.plane])) - model.radius[pair.a]
        return gap, normal, np.inf
    between = x[pair.a] - x[pair.b]
    distance = float(np.sqrt(between @ between))
    return distance - float(model.radius[pair.a] + model.radius[pair.b]), between / distance, distance


def normal_row(pair: Pair, normal: F64) -> F64:
    """Gradient of the gap (eq. 39), (6,) or (12,)."""
    zero = np.zeros(3)
    if pair.plane >= 0:
        return np.concatenate([normal, zero])
    return np.concatenate([normal, zero, -normal, zero])


def normal_curvature(normal: F64, distance: float) -> F64:
    """Second derivative of the gap (eq. 42 with its zero rotation rows), (12,12); zero (6,6) at a plane."""
    if not np.isfinite(distance):
        return np.zeros((6, 6))
    block = (np.eye(3) - np.outer(normal, normal)) / distance
    result = np.zeros((12, 12))
    result[0:3, 0:3] = result[6:9, 6:9] = block
    result[0:3, 6:9] = result[6:9, 0:3] = -block
    return result


def tangents_of(normal: F64) -> F64:
    """t_1 and t_2 = n x t_1, (2,3): eq. 32 with e the axis farthest from the normal."""
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(normal)))] = 1.0
    first = np.cross(axis, normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def friction_of(pair: Pair, sliding: list[F64], u_n: F64 | None) -> float:
    """mu of the pair; a law takes the slip speed |G_T v_n| of the rows `sliding`, u_n (6N,) generalised velocity."""
    law = pair.law.friction_law
    if law is None:
        return pair.law.friction
    if u_n is None:
        raise ValueError(f"pair {pair.key}: its friction law needs the velocities at the start of the step")
    u = np.concatenate([u_n[6 * body : 6 * body + 6] for body in pair.bodies])
    speed = float(np.hypot(*(row @ u for row in sliding)))
    friction = law.value(speed)
    if not friction >= 0.0:
        raise ValueError(f"pair {pair.key}: the friction law gives {friction} at a slip speed of {speed} m/s")
    return friction


def element(
    model: Model,
    pair: Pair,
    x_n: F64,
    u_n: F64 | None = None,
    tangents: F64 | None = None,
    normal: F64 | None = None,
) -> Element:
    """Build the element of a pair with the frame of t_n; `tangents` (2,3) and `normal` (3,) replace those at `x_n`.

    `x_n` (N,3) centres, `u_n` (6N,) velocities of t_n, needed where friction depends on them.
    """
    n = gap_and_normal(model, pair, x_n)[1] if normal is None else normal
    t = tangents_of(n) if tangents is None else tangents
    radii = model.radius[list(pair.bodies)]
    sides = [(1.0, float(radii[0])), *((-1.0, float(r)) for r in radii[1:])]
    law, zero = pair.law, np.zeros(3)
    rows = [normal_row(pair, n)]
    discs = []
    inv_mass = float(np.sum(1.0 / model.mass[list(pair.bodies)]))
    inv_inertia = float(np.sum(1.0 / model.inertia[list(pair.bodies)]))
    inv_slip = inv_mass + float(np.sum(radii**2 / model.inertia[list(pair.bodies)]))
    delassus = [inv_mass]
    # t.(n x r w) = r (t x n).w, with the same sign for both spheres (eq. 34)
    sliding = [
        np.concatenate([part for s, r in sides for part in (s * tangent, r * np.cross(tangent, n))])
        for tangent in t
    ]
    friction = friction_of(pair, sliding, u_n)
    if friction > 0.0:
        discs.append(Disc("T", len(rows), len(rows) + 2, friction))
        rows += sliding
        delassus += [inv_slip] * 2
    if law.rolling_radius > 0.0:
        discs.append(Disc("R", len(rows), len(rows) + 2, law.rolling_radius))
        for tangent in t:
            rows.append(np.concatenate([part for s, _ in sides for part in (zero, s * tangent)]))
        delassus += [inv_inertia] * 2
    if law.spinning_radius > 0.0:
        discs.append(Disc("S", len(rows), len(rows) + 1, law.spinning_radius))
        rows.append(np.concatenate([part for s, _ in sides for part in (zero, s * n)]))
        delassus.append(inv_inertia)
    return Element(pair, n, t, np.stack(rows), tuple(discs), np.array(delassus))


@dataclass(frozen=True)
class Impulse:
    """What B does to A through a contact, in world axes, so that the choice of tangents does not matter.

    `normal` [N s; at position level N s^2] along the normal of t_{n+1}; `friction` (3,) along the plane of
    contact of t_n; `moment` (3,) [N m s] rolling and spinning.
    """

    normal: float
    friction: F64
    moment: F64


def to_world(e: Element, multipliers: F64) -> Impulse:
    """Multipliers (k,) of an element as world vectors."""
    friction, moment = np.zeros(3), np.zeros(3)
    for disc in e.discs:
        part = multipliers[disc.start : disc.stop]
        if disc.kind == "T":
            friction = part @ e.tangents
        elif disc.kind == "R":
            moment = moment + part @ e.tangents
        else:
            moment = moment + part[0] * e.normal
    return Impulse(float(multipliers[0]), friction, moment)


def from_world(e: Element, impulse: Impulse) -> F64:
    """The inverse of `to_world`, (k,)."""
    result = np.zeros(len(e.rows))
    result[0] = impulse.normal
    for disc in e.discs:
        if disc.kind == "T":
            result[disc.start : disc.stop] = e.tangents @ impulse.friction
        elif disc.kind == "R":
            result[disc.start : disc.stop] = e.tangents @ impulse.moment
        else:
            result[disc.start] = e.normal @ impulse.moment
    return result
