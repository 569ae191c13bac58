"""Stress and granular temperature.

Stress is positive in compression, as usual for grains. Of a tensor the first index is the normal of a plane, the second the
direction of the force: `tensor[2, 0]` is the force along x that what is below a horizontal plane exerts on what is above,
per area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64
from carom.errors import CaromError
from carom.measure.granular.region import Region, images, inside, line_share
from carom.measure.granular.shown import Measure, part
from carom.measure.granular.snapshot import Snapshot, Source, snapshot

_TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True, repr=False)
class Stress(Measure):
    """Mean stress of a region, Pa, positive in compression."""

    contact: F64
    """Love-Weber: sum of branch_i force_j over the contacts, per volume, (3, 3)."""
    kinetic: F64
    """Sum of m v'_i v'_j over the balls, per volume, (3, 3); v' is the velocity against the mean of the region, where the
    periodic box deforms against its mean flow and the mean of what is left.
    """
    volume: float
    """Of the region, m^3."""

    @property
    def tensor(self) -> F64:
        """Both parts, (3, 3)."""
        return self.contact + self.kinetic

    @property
    def symmetric(self) -> F64:
        """Symmetric part, (3, 3)."""
        return 0.5 * (self.tensor + self.tensor.T)

    @property
    def asymmetry(self) -> float:
        """Norm of the antisymmetric part over that of the symmetric one. Small where the balls turn steadily, large where
        moments are not in balance: in impacts, at the borders of small regions, with rolling friction.
        """
        whole = float(np.linalg.norm(self.symmetric))
        return float(np.linalg.norm(0.5 * (self.tensor - self.tensor.T))) / whole if whole > 0 else 0.0

    @property
    def pressure(self) -> float:
        """A third of the trace."""
        return float(np.trace(self.tensor)) / 3.0

    @property
    def deviatoric(self) -> float:
        """q = sqrt(3/2 s_ij s_ij) of the symmetric deviator s."""
        s = self.symmetric - self.pressure * np.eye(3)
        return float(np.sqrt(1.5 * (s * s).sum()))

    @property
    def principal(self) -> tuple[F64, F64]:
        """Principal stresses, largest first, (3,), and their directions as columns, (3, 3)."""
        values, directions = np.linalg.eigh(self.symmetric)
        return values[::-1], directions[:, ::-1]


def stress(source: Source, region: Region, frame: int = -1) -> Stress:
    """Mean stress in a region.

    A contact counts with the part of its branch that lies in the region, a ball with the part of its volume. Then the mean
    of a component over a slab is the mean over its planes of the force that crosses them, whatever the slab cuts. A part of
    which something is not known is refused when it is asked for.
    """
    s = snapshot(source, frame)
    return Stress(part(lambda: _contact(s, region)), part(lambda: _kinetic(s, region)), region.volume)


def _contact(s: Snapshot, region: Region) -> F64:
    c = s.touching
    end = s.position[c.first]
    rows, moved = images(region, end, np.linalg.norm(s.branch, axis=1), s.box)
    share = np.bincount(rows, line_share(region, moved - s.branch[rows], moved), minlength=len(end))
    return np.asarray(np.einsum("c,ci,cj->ij", share, s.branch, c.force) / region.volume)


def _kinetic(s: Snapshot, region: Region) -> F64:
    there = s.present
    share = (s.within(region) / s.volume)[there]
    mass, velocity = s.known("mass")[there] * share, s.against_flow[there]
    if not mass.sum() > 0:
        return np.zeros((3, 3))
    away = velocity - (mass @ velocity) / mass.sum()
    return np.asarray(np.einsum("c,ci,cj->ij", mass, away, away) / region.volume)


def ball_stress(source: Source, frame: int = -1) -> F64:
    """Mean stress within each ball from the forces on its surface, (N, 3, 3), Pa, positive in compression.

    Times the volumes of the balls and summed it gives the contact part of the whole, but for gaps.
    """
    s = snapshot(source, frame)
    c, n = s.touching, len(s.radius)
    moment = np.zeros((n, 3, 3))
    dyad = np.einsum("ci,cj->cij", c.normal, c.force)
    np.add.at(moment, c.first, dyad * s.radius[c.first][:, None, None])
    inner = c.second < n
    second = c.second[inner]
    np.add.at(moment, second, dyad[inner] * s.radius[second][:, None, None])
    return np.asarray(moment / s.volume[:, None, None])


@dataclass(frozen=True, repr=False)
class Temperature(Measure):
    """Granular temperature of a region, m^2/s^2; not a number where there are too few balls."""

    translational: float
    """Mass average of |v'|^2 / 3."""
    rotational: float
    """The same of the rotation: sum of I |w'|^2 / 3 over the mass."""
    tensor: F64
    """Mass average of v'_i v'_j, (3, 3); its trace is three times the translational temperature."""
    velocity: F64
    """Mean velocity, (3,), m/s."""
    gradient: F64
    """Of the mean velocity, d v_i / d x_j, (3, 3), 1/s; where a uniform mean was removed that of the deforming box, or 0."""
    balls: int


def granular_temperature(
    source: Source, frame: int = -1, *, region: Region | None = None, mean: str = "uniform"
) -> Temperature:
    """Granular temperature of the balls whose centre is in the `region`, or of all.

    What fluctuates is the velocity v' against the mean field: `mean` "uniform" (one velocity), "affine" (a velocity that
    varies linearly, fitted), or "none". Where the periodic box deforms its mean flow is taken off first, also with "none":
    another image of a ball has another velocity. The numbers of fitted coefficients are taken off the number of balls, so
    that few balls do not seem colder.
    """
    fitted = {"none": 0, "uniform": 1, "affine": 4}
    if mean not in fitted:
        raise CaromError(f"unknown mean field {mean!r}; known: {', '.join(fitted)}")
    s = snapshot(source, frame)
    there, place = s.present, s.folded[s.present]
    if region is not None:
        rows, place = inside(region, s.position[there], s.box)
        there = there[rows]
    n = len(there)
    nothing = np.full((3, 3), np.nan)
    if n <= fitted[mean]:
        return Temperature(np.nan, np.nan, nothing, nothing[0], nothing, n)
    mass, v = s.known("mass")[there], s.against_flow[there]
    total = float(mass.sum())
    average = mass @ v / total
    gradient: F64 = np.zeros((3, 3))
    field = np.zeros_like(v)
    if s.box is not None and s.box.deforms:
        flow = s.box.flow_velocity(place)
        v, average = v + flow, average + mass @ flow / total  # of the images that are there
        field, gradient = flow, s.box.velocity_gradient
    if mean != "none":
        field = field + (average - mass @ field / total)
    if mean == "affine":
        x = place - mass @ place / total
        root = np.sqrt(mass)[:, None]
        gradient = np.asarray(np.linalg.lstsq(root * x, root * (v - average), rcond=None)[0].T)
        field = average + x @ gradient.T
    away = v - field
    tensor = np.einsum("c,ci,cj->ij", mass, away, away) / total * n / (n - fitted[mean])
    rotational = part(lambda: _rotational(s, there, mean != "none") / total)
    return Temperature(float(np.trace(tensor)) / 3.0, rotational, tensor, average, gradient, n)


def _rotational(s: Snapshot, there: I64, against_mean: bool) -> float:
    """Sum of I |w'|^2 / 3 of some balls, as many as the mean leaves free."""
    spin, inertia, n = s.known("angular_velocity")[there], s.known("inertia")[there], len(there)
    turning = inertia @ spin / max(float(inertia.sum()), _TINY) if against_mean else np.zeros(3)
    turn = spin - turning
    return float((inertia * (turn**2).sum(axis=1)).sum()) / 3.0 * n / (n - against_mean)
