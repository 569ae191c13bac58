"""Advice on restitution with friction: where Newton's law lets an impact on two contacts of a ball gain energy (Kane).

With `eps = (1 - e)/(1 + e)` for each row, `D = G M^-1 G^T` and impulses `L` the energy of an impact changes by

    dT = sum_T z.L/(1 + e_T) - 1/2 sum_rows eps L (D L),      z.L <= 0 in friction,

since `z = v+ + e v-` and `v+ - v- = D L` in every row. If all `eps` are equal nothing is gained; nor is it at one contact of
a sphere, whose rows do not mix (D_NT = 0). Two contacts of a ball mix: the friction of one moves the ball along the normal
of the other. Wherever the second sum is negative for impulses within their cones, the velocities `v- = -D L/(1 + e)` are
those of an impact that sticks (z = 0) and gains. The largest gain over all such impulses is what the advice tells.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from carom.arrays import F64
from carom.errors import quoted
from carom.scene.assembly.placing import FLAT, Placed
from carom.scene.assembly.vectors import dot
from carom.scene.checks.rules import Whole
from carom.scene.messages import Finding
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.laws import value_at
from carom.scene.tables.model import Contact

WORTH_TELLING = 0.02
"""Gain over the kinetic energy before the impact from which a message warns of it."""
ANGLES, DIVISIONS, SLIPS = 25, 24, 13
"""Points of the search: angles between the normals, division of the normal impulse, friction within its bound."""
SEARCHES = 7
"""Halvings that find a restitution without gain: to 0.01."""


@dataclass(frozen=True)
class Side:
    """One contact of a ball: its law, and the body on its other side over the ball's own mass (0: a wall)."""

    friction: float
    normal: float
    """e_N."""
    tangential: float
    """e_T."""
    inverse_mass: float = 0.0
    inverse_spin: float = 0.0
    """r^2/I of the body on the other side, times the mass of the ball."""
    rests: bool = False
    """Whether weight presses on the contact: it then takes part in an impact without an approach of its own."""


@dataclass(frozen=True)
class Gain:
    """The most that an impact can gain."""

    share: float
    """Over the kinetic energy before; negative if energy is lost in any case."""
    angle: float
    """Between the normals, rad."""
    before: tuple[float, float, float, float]
    """Velocities of the rows N1, N2, T1, T2 before that impact, up to a factor."""


NO_GAIN = Gain(-math.inf, 0.0, (0.0, 0.0, 0.0, 0.0))


@lru_cache(maxsize=4096)
def largest_gain(first: Side, second: Side, spin: float, angles: tuple[float, float]) -> Gain:
    """Of an impact on two contacts of a ball with r^2/I times mass `spin`, in the plane of the normals, which point to the
    ball and make an angle (rad) between the two given. A contact at rest is the second.

    Both contacts stick. Between two walls one of them slips: the ball has three degrees of freedom for the four rows.
    """
    slips, bounds = np.linspace(-1, 1, SLIPS), np.array([-1.0, 1.0])
    walls = not first.inverse_mass + second.inverse_mass
    found = []
    for angle in np.unique(np.linspace(*angles, ANGLES)):
        compliance = _compliance(first, second, spin, float(angle))
        for slipping in (2, 3) if walls else (None,):
            s1, s2 = bounds if slipping == 2 else slips, bounds if slipping == 3 else slips
            impulse = _impulses(first, second, compliance, s1, s2)
            found.append(_most(first, second, compliance, impulse, slipping, float(angle)))
    return max(found, key=lambda gain: gain.share)


def _impulses(first: Side, second: Side, compliance: F64, s1: F64, s2: F64) -> F64:
    """Impulses of the rows N1, N2, T1, T2 to be tried, (4, K); friction is a share `s1`, `s2` of its bound."""
    divisions = [0.0] if second.rests else np.linspace(0, np.pi / 2, DIVISIONS + 1)
    part, s1, s2 = (a.ravel() for a in np.meshgrid(divisions, s1, s2, indexing="ij"))
    n1, n2 = np.cos(part), np.sin(part)
    t1 = first.friction * n1 * s1
    if second.rests:  # it did not approach: its normal velocity is 0 before and after
        n2 = -(compliance[1, 0] * n1 + compliance[1, 2] * t1) / compliance[1, 1]
    impulse = np.array([n1, n2, t1, second.friction * n2 * s2])
    return np.asarray(impulse[:, n2 >= 0])


def _most(
    first: Side, second: Side, compliance: F64, impulse: F64, slipping: int | None, angle: float
) -> Gain:
    """The largest gain among the impulses; the row `slipping` slips after the impact by what the other rows leave it."""
    e = np.array([first.normal, second.normal, first.tangential, second.tangential])
    change = compliance @ impulse
    after = np.zeros_like(change)  # z
    if slipping is not None:
        dependence = np.linalg.eigh(compliance)[1][:, 0]
        weights = dependence / (1 + e)
        if abs(weights[slipping]) < 1e-9:
            return NO_GAIN
        after[slipping] = weights @ change / weights[slipping]
    before = (after - change) / (1 + e)[:, None]
    gained = ((after / (1 + e)[:, None] - 0.5 * ((1 - e) / (1 + e))[:, None] * change) * impulse).sum(axis=0)
    # whatever else moves only adds to the energy before
    energy = 0.5 * np.einsum("in,ij,jn->n", before, np.linalg.pinv(compliance), before)
    possible = (before[:2] <= 1e-12).all(axis=0) & (energy > 1e-9) & (after * impulse <= 0).all(axis=0)
    if not possible.any():
        return NO_GAIN
    share = np.where(possible, gained / np.where(possible, energy, 1.0), -math.inf)
    k = int(share.argmax())
    w1, w2, u1, u2 = before[:, k].tolist()
    return Gain(float(share[k]), angle, (w1, w2, u1, u2))


def _compliance(first: Side, second: Side, spin: float, angle: float) -> F64:
    """D of the rows N1, N2, T1, T2 times the mass of the ball; tangents are the normals turned by a right angle."""
    c, s = math.cos(angle), math.sin(angle)
    shared = np.array(
        [[1.0, c, 0.0, -s], [c, 1.0, s, 0.0], [0.0, s, 1 + spin, c + spin], [-s, 0.0, c + spin, 1 + spin]]
    )
    others = [side.inverse_mass for side in (first, second)]
    return shared + np.diag([*others, *(side.inverse_mass + side.inverse_spin for side in (first, second))])


@dataclass(frozen=True)
class _Partner:
    """What a kind of ball can touch: a kind of ball, or a flat wall."""

    law: int
    side: Side
    kind: int = -1
    """Index of the material of balls."""
    radius: float = math.inf
    wall: Placed | None = None

    @property
    def rests(self) -> bool:
        return self.side.rests

    @property
    def by_chance(self) -> bool:
        return self.wall is not None and not self.rests


def advise_gain(parts: Whole) -> Iterator[Finding]:
    """For each contact law the largest gain of an impact on a contact of it and another one."""
    options = parts.run.options()
    if options["method"] == "penalty":
        return
    impact = LAWS[options["impact"]]
    for i, contact in parts.contacts():
        for key, usual in (("tangential_restitution", 0.0), ("stiffness_ratio", 1.0)):
            if (value := getattr(contact, key)) == usual or key in impact.needs:
                continue
            cause = f"{key} = {value:g}: the impact law {options['impact']} does not read it"
            yield Finding(("contact", i, key), cause, "leave it out, or take another impact law")
    printed = impact.restitution == "printed"
    if impact.restitution != "newton" and not printed:
        return
    guarded = options["energy_safeguard"] and impact.energy
    laws = dict(parts.contacts())
    worst: dict[int, tuple[float, int, str]] = {}
    for law, other, share, safe in _gains(parts, guarded, printed):
        if share > worst.get(law, (WORTH_TELLING,))[0]:
            worst[law] = (share, other, safe)
    for i, (share, other, safe) in sorted(worst.items()):
        e_n, e_t = value_at(laws[i].restitution, 0.0), laws[i].tangential_restitution
        means = f"e_N = {e_n:g}" + (f", e_T = {e_t:g}" if e_t else "")
        with_ = "two such contacts" if other == i else f"this contact and one of {_pair(laws[other])}"
        cause = (
            f"{means} with friction: by Newton's law an impact on {with_} of a ball at once can gain energy"
        )
        cause += f", at most {100 * share:.1f} % (Kane)"
        cure = safe + (
            "; otherwise restitution is scaled down in such an impact, and the summary counts it"
            if guarded
            else '; impact = "sequence" with energy_safeguard = true scales restitution down where it would'
        )
        yield Finding(("contact", i, "restitution"), cause, cure)


def _gains(parts: Whole, guarded: bool, paper: bool) -> Iterator[tuple[int, int, float, str]]:
    """(law, other law, gain, cure) of every pair of contacts that a ball can have; `law` has the larger restitution.

    Where the energy safeguard is at work, pairs that meet by chance alone are left out: those with a wall that no weight
    presses on, as a cushion, unless the other contact is one that lasts.
    """
    bodies, names = parts.bodies(), parts.materials()
    laws = {frozenset(law.between): (i, law) for i, law in parts.contacts()}
    single = bodies.clump < 0  # impacts of clumps follow other measures
    kinds = [k for k in np.unique(bodies.material[single]).tolist() if k >= 0]
    count = {k: int((single & (bodies.material == k)).sum()) for k in kinds}
    for kind in kinds:
        own = np.flatnonzero(single & (bodies.material == kind))
        ball = int(own[bodies.mass[own].argmin()])  # beside it all else is heavy
        mass, radius = float(bodies.mass[ball]), float(bodies.radius[ball])
        spin = mass * radius**2 / float(bodies.inertia[ball])
        partners = []
        for k in kinds:
            if (found := laws.get(frozenset((names[kind], names[k])))) and count[k] > (k == kind):
                those = np.flatnonzero(single & (bodies.material == k))
                heavy = int(those[bodies.mass[those].argmax()])
                ratio = mass / float(bodies.mass[heavy])
                r = float(bodies.radius[heavy])
                own_spin = ratio * r**2 * float(bodies.mass[heavy]) / float(bodies.inertia[heavy])
                side = _side(found[1], inverse_mass=ratio, inverse_spin=own_spin)
                partners.append(_Partner(found[0], side, kind=k, radius=r))
        for wall in parts.walls():
            if wall.kind in FLAT and (found := laws.get(frozenset((names[kind], wall.material)))):
                side = _side(found[1])
                if dot(parts.world.gravity, wall.shape[1]) < 0:
                    side = replace(side, normal=0.0, tangential=side.tangential if paper else 0.0, rests=True)
                partners.append(_Partner(found[0], side, wall=wall))
        for a, b in combinations_with_replacement(partners, 2):
            angles = _angles(a, b, radius)
            if angles is None or (a is b and count[a.kind] < 2 + (a.kind == kind)):
                continue
            if guarded and (a.by_chance or b.by_chance) and not (a.rests or b.rests):
                continue
            if a.rests and b.rests:  # whose loads are settled without restitution
                continue
            first, second = (a, b) if b.rests or (a.side.normal > b.side.normal and not a.rests) else (b, a)
            gain = largest_gain(first.side, second.side, spin, angles)
            if gain.share > WORTH_TELLING:
                yield first.law, second.law, gain.share, _cure(first, second, spin, angles)


def _side(law: Contact, inverse_mass: float = 0.0, inverse_spin: float = 0.0) -> Side:
    friction = value_at(law.friction, 0.0)
    e_n = value_at(law.restitution, 0.0)
    return Side(friction, e_n, law.tangential_restitution, inverse_mass, inverse_spin)


def _angles(a: _Partner, b: _Partner, radius: float) -> tuple[float, float] | None:
    """Between which the angle of the normals lies; None if a ball cannot touch both.

    Two balls leave room for each other. A ball beside one that rests on a wall rests there, too.
    """
    if a.wall is not None and b.wall is not None:
        if a.wall is b.wall:
            return None
        along = max(-1.0, min(1.0, dot(a.wall.shape[1], b.wall.shape[1])))
        return (math.acos(along),) * 2 if abs(along) < 1 - 1e-9 else None
    if a.wall is None and b.wall is None:
        to_a, to_b, apart = radius + a.radius, radius + b.radius, a.radius + b.radius
        return math.acos((to_a**2 + to_b**2 - apart**2) / (2 * to_a * to_b)), math.pi
    wall, ball = (a, b) if a.wall is not None else (b, a)
    beside = math.acos((radius - ball.radius) / (radius + ball.radius))
    return (beside, beside if wall.rests else math.pi)


def _cure(first: _Partner, second: _Partner, spin: float, angles: tuple[float, float]) -> str:
    """A restitution of the first contact (of both, if their law is the same) with which nothing is gained."""

    def share(e: float) -> float:
        one = replace(first.side, normal=e)
        other = (
            replace(second.side, normal=e) if second.law == first.law and not second.rests else second.side
        )
        return largest_gain(one, other, spin, angles).share

    low, high = 0.0, first.side.normal
    if share(low) > 0:
        return "a tangential_restitution near 0 or less friction gains less"
    for _ in range(SEARCHES):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share(middle) <= 0 else (low, middle)
    return f"restitution = {math.floor(100 * low) / 100:g} cannot"


def _pair(law: Contact) -> str:
    return "-".join(quoted(name) for name in law.between)
