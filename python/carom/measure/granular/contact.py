"""Contacts as a network: how many, in which directions, with which forces, and the chains of strong ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool, connected
from carom.errors import CaromError
from carom.measure.granular.region import Region, inside
from carom.measure.granular.shown import Measure
from carom.measure.granular.snapshot import Snapshot, Source, snapshot
from carom.numeric import is_number, is_whole
from carom.scene.packing.neighbours import pairs


@dataclass(frozen=True, repr=False)
class Coordination(Measure):
    """Numbers of contacts. Rattlers are balls with too few contacts, and those that are left with too few without them."""

    per_ball: I64
    """Contacts of each ball, (N,)."""
    per_ball_without_rattlers: I64
    """Contacts of each ball with balls that are no rattlers and with walls, (N,); 0 for rattlers."""
    rattler: Bool
    """Whether a ball is one, (N,)."""
    counted: Bool
    """Balls of which the means are taken: those in the region, (N,)."""

    @property
    def mean(self) -> float:
        """Z, contacts of a ball on average."""
        return _mean(self.per_ball[self.counted])

    @property
    def mean_without_rattlers(self) -> float:
        """The mechanical coordination number: the average over the balls that are no rattlers."""
        return _mean(self.per_ball_without_rattlers[self.counted & ~self.rattler])

    @property
    def rattlers(self) -> float:
        """Share of the balls that are rattlers."""
        return _mean(self.rattler[self.counted])


def coordination(
    source: Source,
    frame: int = -1,
    *,
    region: Region | None = None,
    gap: float | None = None,
    walls: bool = True,
    least: int = 2,
) -> Coordination:
    """Coordination numbers.

    A contact counts that is closed at the frame and pushed since the frame before; with `gap` (m) every two surfaces nearer
    than that count instead, which needs no recorded contacts. A ball touches a mesh as often as their distance has a local
    minimum: three times in a corner. `walls`: whether contacts with walls count. A ball with fewer
    than `least` contacts is a rattler. Averages are over the balls whose centre is in the `region`, or over all.
    """
    s = snapshot(source, frame)
    n = len(s.radius)
    if gap is not None and not (is_number(gap) and gap >= 0):
        found = f"{gap:g} m" if is_number(gap) else repr(gap)
        raise CaromError(f"coordination: gap = {found}; surfaces are near each other from 0 m on")
    if not is_whole(least):
        raise CaromError(f"coordination: least = {least!r}; give a whole number of contacts")
    if gap is None:
        c = s.touching
        real = c.closed & (c.push > 0)
        first, second = c.first[real], c.second[real]
    else:
        first, second = _near(s, gap)
    if not walls:
        first, second = first[second < n], second[second < n]
    present = np.isin(np.arange(n), s.present)
    per_ball = _count(first, second, n)
    kept = present.copy()
    inner = per_ball
    while (kept & (inner < least)).any():
        kept &= inner >= least
        real = kept[first] & ((second >= n) | kept[np.minimum(second, n - 1)])
        inner = _count(first[real], second[real], n)
    counted = present
    if region is not None:
        counted = np.zeros(n, dtype=bool)
        counted[s.present[inside(region, s.position[s.present], s.box)[0]]] = True
    return Coordination(per_ball, np.where(kept, inner, 0), present & ~kept, counted)


def _mean(values: I64 | Bool) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _count(first: I64, second: I64, n: int) -> I64:
    return np.bincount(first, minlength=n)[:n] + np.bincount(second, minlength=n)[:n]


def _near(s: Snapshot, gap: float) -> tuple[I64, I64]:
    """Pairs of balls, and of balls and walls, whose surfaces are nearer than `gap`; of meshes each place counts."""
    n, there = len(s.radius), s.present
    a, b = pairs(s.position[there], s.radius[there] + 0.5 * gap, s.box)
    first, second = [there[a]], [there[b]]
    walls = s.walls
    if walls is None:
        walls = tuple(_half_space(*plane) for plane in zip(*s.planes, strict=True)) if s.planes else ()
    for k, met in enumerate(walls):
        near = there[met(s.position[there], s.radius[there], gap)]
        first.append(near)
        second.append(np.full(len(near), n + k))
    return np.concatenate(first), np.concatenate(second)


def _half_space(point: F64, normal: F64) -> Callable[[F64, F64, float], I64]:
    return lambda centre, radius, gap: np.flatnonzero((centre - point) @ normal - radius <= gap)


@dataclass(frozen=True, repr=False)
class Fabric(Measure):
    """How contact normals are directed. The density of directions n is about (1 + a_ij n_i n_j) / 4 pi."""

    tensor: F64
    """Mean of n_i n_j, (3, 3), of trace 1."""
    contacts: int

    @property
    def deviator(self) -> F64:
        """a = 15/2 (tensor - 1/3), (3, 3)."""
        return np.asarray(7.5 * (self.tensor - np.eye(3) / 3.0))

    @property
    def anisotropy(self) -> float:
        """sqrt(3/2 a_ij a_ij), 0 where all directions are alike."""
        return float(np.sqrt(1.5 * (self.deviator**2).sum()))

    @property
    def principal(self) -> tuple[F64, F64]:
        """Principal values, largest first, (3,), and their directions as columns, (3, 3)."""
        values, directions = np.linalg.eigh(self.tensor)
        return values[::-1], directions[:, ::-1]


def fabric(
    source: Source,
    frame: int = -1,
    *,
    region: Region | None = None,
    walls: bool = False,
    by_force: bool = False,
) -> Fabric:
    """The contact-orientation (fabric) tensor of the contacts that push.

    `by_force` weights each by its normal force, which gives the tensor of the force network. With a `region` only contacts
    whose point lies in it count.
    """
    s = snapshot(source, frame)
    normal, push = _pushing(s, region, walls)
    if not len(push):
        return Fabric(np.full((3, 3), np.nan), 0)
    weight = push / push.sum() if by_force else np.full(len(push), 1.0 / len(push))
    return Fabric(np.einsum("c,ci,cj->ij", weight, normal, normal), len(push))


@dataclass(frozen=True, repr=False)
class NormalForces(Measure):
    """The distribution of normal forces over their mean."""

    mean: float
    """N."""
    ratio: F64
    """Every force over the mean, in rising order, (C,)."""
    edges: F64
    """Of the bins, (B + 1,), over the mean."""
    density: F64
    """Probability density in the bins, (B,)."""
    error: F64
    """Its standard error from the number of contacts, (B,)."""

    @property
    def weak(self) -> float:
        """Share of the contacts below the mean."""
        return float((self.ratio < 1.0).mean())


def normal_forces(
    source: Source,
    frame: int = -1,
    *,
    region: Region | None = None,
    walls: bool = False,
    bins: int = 30,
    most: float = 6.0,
) -> NormalForces:
    """The distribution of the normal forces of all contacts that push, in `bins` up to `most` times the mean."""
    if not (is_whole(bins) and bins >= 1 and is_number(most) and 0 < most < np.inf):
        raise CaromError(
            f"normal_forces: {bins!r} bins up to {most!r}; give numbers above 0, of bins a whole one"
        )
    s = snapshot(source, frame)
    _, push = _pushing(s, region, walls)
    if not len(push):
        raise CaromError("no contact pushes at this frame; take a later one, or a larger region")
    ratio = np.sort(push) / push.mean()
    counts, edges = np.histogram(ratio, bins, (0.0, most))
    unit = len(ratio) * np.diff(edges)
    return NormalForces(float(push.mean()), ratio, edges, counts / unit, np.sqrt(counts) / unit)


@dataclass(frozen=True, repr=False)
class ForceChains(Measure):
    """Contacts that carry much, and the chains that they form: two of them that share a ball belong to one."""

    threshold: float
    """Normal force from which a contact counts, N."""
    first: I64
    """Balls of the K contacts, (K,)."""
    second: I64
    """Their other balls or, from N on, walls, (K,)."""
    push: F64
    """Normal forces, (K,), N."""
    start: F64
    """Ends of the lines from centre to centre (or to the wall), (K, 3), m."""
    end: F64
    """The other ends, (K, 3), m."""
    chain: I64
    """Number of the chain of each contact, (K,); chain 0 is the largest."""
    sizes: I64
    """Contacts of each chain, largest first."""
    share_of_contacts: float
    """Part of all contacts that are in chains."""
    share_of_force: float
    """Part of the sum of all normal forces that they carry."""

    def of(self, chain: int) -> I64:
        """Rows of the contacts of a chain."""
        return np.flatnonzero(self.chain == chain)

    def balls(self, chain: int) -> I64:
        """The balls of a chain."""
        rows = self.of(chain)
        walls = self.second[rows] >= self._balls
        return np.unique(np.concatenate([self.first[rows], self.second[rows][~walls]]))

    _balls: int = 0


def force_chains(
    source: Source, frame: int = -1, *, above: float = 1.0, least: int = 2, walls: bool = True
) -> ForceChains:
    """Chains of contacts whose normal force is at least `above` times the mean, each of `least` contacts or more."""
    s = snapshot(source, frame)
    c, n = s.touching, len(s.radius)
    all_pushing = np.flatnonzero((c.push > 0) & (walls | (c.second < n)))
    if not len(all_pushing):
        raise CaromError("no contact pushes at this frame; take a later one")
    everything = c.push[all_pushing]
    threshold = above * float(everything.mean())
    rows = all_pushing[everything >= threshold]
    inner = rows[c.second[rows] < n]
    label = connected(n, c.first[inner], c.second[inner])[c.first[rows]]
    _, label, sizes = np.unique(label, return_inverse=True, return_counts=True)
    order = np.argsort(-sizes, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    kept = sizes[label] >= least
    rows, sizes = rows[kept], sizes[order]
    return ForceChains(
        threshold=threshold,
        first=c.first[rows],
        second=c.second[rows],
        push=c.push[rows],
        start=s.position[c.first[rows]] - s.branch[rows],
        end=s.position[c.first[rows]],
        chain=rank[label[kept]],
        sizes=sizes[sizes >= least],
        share_of_contacts=len(rows) / len(all_pushing),
        share_of_force=float(c.push[rows].sum() / everything.sum()),
        _balls=n,
    )


def _pushing(s: Snapshot, region: Region | None, walls: bool) -> tuple[F64, F64]:
    """Normals and normal forces of the contacts that push, those in a region or all."""
    c, n = s.touching, len(s.radius)
    kept = (c.push > 0) & (walls | (c.second < n))
    if region is not None:
        point = s.position[c.first] - c.normal * s.radius[c.first][:, None]
        here = np.zeros(len(point), dtype=bool)
        here[inside(region, point, s.box)[0]] = True
        kept &= here
    return c.normal[kept], c.push[kept]
