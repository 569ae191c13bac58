"""`Builder`: the calls of a `carom.Scene` that add materials, contact laws and balls."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from carom.arrays import F64
from carom.errors import Problem, ScenarioError, quoted
from carom.scene.arguments import explained
from carom.scene.assembly.filling import circumscribed, random_turns
from carom.scene.messages import from_python
from carom.scene.packing import PackingError
from carom.scene.tables.balls import Lattice, Rack, Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.clumps import Clump
from carom.scene.tables.model import Contact, Material, Scenario
from carom.scene.tables.packing import Packing
from carom.scene.tables.quantities import ZEROS
from carom.scene.tables.walls import WALLS

Number = float | str
"""A number in SI or a string with a unit."""
Vector = Sequence[Number] | F64
LOOSE = 0.6
"""Fraction of the balls about clumps at most: a little less than that of random packings."""
_FIXED = frozenset({str, int, float, bool, type(None)})
"""Types of values that have no parts: most there are."""
_T = TypeVar("_T", bound=Table)
_V = TypeVar("_V")


def make(table: type[_T], label: str, **given: Any) -> _T:
    """A checked table; arguments that are None count as not given."""
    given = {key: value for key, value in given.items() if value is not None}
    try:
        return table.model_validate(given)
    except ValidationError as e:
        raise from_python(e, table, label, given) from None


def own(value: _V) -> _V:
    """A copy that shares with `value` what cannot be changed, and functions: tables, lists and laws are new."""
    if isinstance(value, Table):
        value = value.model_copy()
        value.__dict__ |= {key: own(part) for key, part in value.__dict__.items() if type(part) not in _FIXED}
    elif isinstance(value, list) or (isinstance(value, tuple) and not _FIXED.issuperset(map(type, value))):
        return type(value)(map(own, value))
    elif isinstance(value, dict):
        return type(value)((key, own(part)) for key, part in value.items())
    return value


class Builder:
    """What a scene is made of; `carom.Scene` adds reading, writing and checking."""

    _tree: Scenario
    _names: set[str] | None  # of single spheres, clumps and walls, some renamed since; None: not known

    @explained
    def material(self, name: str) -> Material:
        """Declare a material. Not needed before it is used: spheres, planes and contacts declare theirs."""
        material = make(Material, f"Scene.material({quoted(name)})", name=name)
        for known in self._tree.material:
            if known.name == name:
                return known
        self._tree.material.append(material)
        return material

    @explained
    def contact(
        self,
        a: str,
        b: str,
        *,
        friction: float | str | Mapping[str, Any],
        restitution: float | str | Mapping[str, Any],
        tangential_restitution: float | None = None,
        rolling_radius: Number | None = None,
        spinning_radius: Number | None = None,
        stiffness_ratio: float | None = None,
        cohesion: Number | None = None,
        rupture_distance: Number | None = None,
    ) -> Contact:
        """The contact law of two materials, which may be the same one. Every pair that can meet needs a law.

        `friction` mu >= 0, a number or a law of the slip speed `v`, as "0.01 + 0.1*exp(-v)" or `{"table": ...}`;
        `restitution` e_N in [0, 1], the same of the approach speed; `tangential_restitution` e_T in (-1, 1];
        `rolling_radius` rho and `spinning_radius` delta: moment that resists rolling or spinning over the normal force, m;
        `stiffness_ratio` over other pairs of equal radii, for impacts through springs; `cohesion` in touch, N, which falls
        linearly to nothing at the gap `rupture_distance`, m.
        """
        label = f"Scene.contact({quoted(a)}, {quoted(b)})"
        contact = make(
            Contact,
            label,
            between=(a, b),
            friction=friction,
            restitution=restitution,
            tangential_restitution=tangential_restitution,
            rolling_radius=rolling_radius,
            spinning_radius=spinning_radius,
            stiffness_ratio=stiffness_ratio,
            cohesion=cohesion,
            rupture_distance=rupture_distance,
        )
        if any({*known.between} == {a, b} for known in self._tree.contact):
            cause = f"there is already a law for {quoted(a)} and {quoted(b)}"
            raise ScenarioError([Problem(label, "", cause, "change the one that contact() returned")])
        self.material(a)
        self.material(b)
        self._tree.contact.append(contact)
        return contact

    @explained
    def sphere(
        self,
        name: str,
        *,
        radius: Number,
        material: str,
        position: Vector | None = None,
        at: Vector | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        inertia: Number | None = None,
        velocity: Vector | None = None,
        angular_velocity: Vector | None = None,
        orientation: Vector | None = None,
    ) -> Sphere:
        """Add a ball and return it; its attributes may be changed (`cue.velocity = (2, 0, 0)`).

        `radius` m; `mass` kg or `density` kg/m^3; `inertia` kg m^2, by default 2/5 m r^2; centre `position`
        (or `at`) m; `velocity` m/s; `angular_velocity` rad/s in fixed axes; `orientation` unit quaternion, w
        first.
        """
        return self._add(Sphere, locals(), _own_name)

    @explained
    def rack(
        self,
        name: str,
        *,
        apex: Vector,
        direction: Vector,
        radius: Number,
        material: str,
        balls: int | None = None,
        rows: int | None = None,
        shape: str | None = None,
        up: Vector | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        inertia: Number | None = None,
        gap: Number | None = None,
        jitter: Number | None = None,
        seed: int | None = None,
        first_number: int | None = None,
    ) -> Rack:
        """Add a billiard rack: `balls` (or `rows`) in a "triangle" or "diamond", from the `apex` along
        `direction`.

        The balls are called `name` + number, row by row from `first_number`, each row from left to right.
        Neighbours are `gap` m apart; `jitter` m moves each centre at random along each axis of the table,
        drawn with `seed`.
        """
        return self._add(Rack, locals())

    @explained
    def lattice(
        self,
        name: str,
        *,
        counts: Sequence[int],
        origin: Vector,
        radius: Number,
        material: str,
        kind: str | None = None,
        spacing: Number | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        inertia: Number | None = None,
        velocity: Vector | None = None,
        jitter: Number | None = None,
        seed: int | None = None,
        first_number: int | None = None,
    ) -> Lattice:
        """Add a grid of balls, "cubic", "bcc", "fcc" or "hcp": `counts` along x, y, z from the centre `origin`, `spacing` m
        (default 2 r).

        The balls are called `name` + number, x fastest; `jitter` m moves each centre at random along each
        axis, drawn with `seed`; `velocity` m/s is that of all balls.
        """
        return self._add(Lattice, locals())

    @explained
    def clump(
        self,
        name: str,
        *,
        spheres: Sequence[Vector] | F64,
        material: str,
        position: Vector | None = None,
        at: Vector | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        inertia: Vector | None = None,
        centre: Vector | None = None,
        orientation: Vector | None = None,
        velocity: Vector | None = None,
        angular_velocity: Vector | None = None,
    ) -> Clump:
        """Add a rigid body made of `spheres`, each [x, y, z, radius] m in own axes, and return it. They may overlap.

        Its balls are called `name` + number, from 1. The origin of its own axes is at `position` (or `at`) m; `orientation`
        (unit quaternion, w first) turns them to the fixed ones. `mass` kg or `density` kg/m^3; `inertia` about the centre of
        mass in own axes, kg m^2, three moments or Jxx, Jyy, Jzz, Jxy, Jxz, Jyz, and `centre` of mass m: by default those of
        the homogeneous body. `velocity` m/s of the centre of mass; `angular_velocity` rad/s in fixed axes.
        """
        return self._add(Clump, locals(), _own_name)

    @explained
    def packing(
        self,
        name: str,
        *,
        material: str,
        density: Number,
        seed: int,
        count: int | None = None,
        fraction: float | None = None,
        gap: Number | None = None,
        sizes: str | None = None,
        diameter: Number | None = None,
        mean: Number | None = None,
        deviation: Number | None = None,
        smallest: Number | None = None,
        largest: Number | None = None,
        classes: Sequence[Sequence[float | str]] | None = None,
        shares: str | None = None,
        region: str | None = None,
        low: Vector | None = None,
        high: Vector | None = None,
        periodic: str | None = None,
        point: Vector | None = None,
        axis: Vector | None = None,
        region_radius: Number | None = None,
        length: Number | None = None,
        velocity: Vector | None = None,
        first_number: int | None = None,
    ) -> Packing:
        """Add balls at random without overlaps: `count` of them, or as many as fill `fraction` of a region.

        `sizes` "equal" (`diameter`), "uniform" (`smallest`, `largest`), "normal" or "lognormal" (`mean`, `deviation`, and
        these limits) or "table" (`classes` of [diameter, share], `shares` by "number" or "mass"); `region` "box" (`low`,
        `high`, and the axes that are `periodic`), "cylinder" (`point`, `axis`, `region_radius`, `length`) or "sphere"
        (`point`, `region_radius`). Lengths in m. `packed()` of what is returned holds the balls and the fraction reached.
        """
        return self._add(Packing, locals())

    @explained
    def clump_packing(
        self,
        name: str,
        *,
        spheres: Sequence[Vector] | F64,
        material: str,
        density: Number,
        seed: int,
        count: int | None = None,
        fraction: float | None = None,
        gap: Number | None = None,
        region: str | None = None,
        low: Vector | None = None,
        high: Vector | None = None,
        periodic: str | None = None,
        point: Vector | None = None,
        axis: Vector | None = None,
        region_radius: Number | None = None,
        length: Number | None = None,
        velocity: Vector | None = None,
    ) -> list[Clump]:
        """Add clumps of one shape at random places, turned at random, without overlaps, and return them.

        `spheres` are those of `clump`, the region is that of `packing`. There are `count` clumps, or as many as fill
        `fraction` of it. Balls about the clumps are packed, so that long ones lie loosely until they fall. They are
        called `name` + number + "-".
        """
        label = f"Scene.clump_packing({quoted(name)})"
        given = {k: v for k, v in locals().items() if k not in ("self", "label", "spheres")}
        shape = make(
            Clump, label, name=name, spheres=spheres, material=material, density=density, position=ZEROS
        )
        reach, solid = circumscribed(shape)
        more = 4.0 / 3.0 * np.pi * reach**3 / solid
        asked = make(Packing, label, **given, diameter=2.0 * reach)
        about = asked.fraction and more * asked.fraction
        if about is not None and about > LOOSE:
            cause = f"{asked.fraction:g} is not within 0 and {LOOSE / more:.3g}: what is packed are balls about the clumps"
            cure = "give less; clumps that fall lie denser"
            raise ScenarioError([Problem(label, "fraction", cause, cure)])
        try:
            packed = asked.model_copy(update={"fraction": about}).packed()
        except PackingError as error:
            cause = f"balls about the clumps, of {more:.3g} times their volume, do not fit: {error.cause}"
            raise ScenarioError(
                [Problem(label, "fraction" if about else "count", cause, error.cure)]
            ) from None
        turns = random_turns(seed, len(packed.position))
        made = [
            shape.placed(place, turn)
            .called(name, k)
            .model_copy(update={"velocity": tuple(map(float, velocity or ZEROS))})
            for k, (place, turn) in enumerate(zip(packed.position, turns, strict=True), 1)
        ]
        for clump in made:
            self._take_name(clump.name, label)
        self.material(material)
        self._tree.clump += made
        return made

    def _add(
        self, table: type[_T], given: dict[str, Any], names: Callable[[_T], Iterable[str]] | None = None
    ) -> _T:
        """Add the table of a call with these `locals()`, and its material; `names`: those that no other may have."""
        given.pop("self")
        at = given.pop("at", None)
        label = f"Scene.{table.section}({quoted(given['name'])})"
        if at is not None and given["position"] is not None:
            cause = "both position and at are given"
            raise ScenarioError([Problem(label, "at", cause, "give one, they mean the same")])
        if at is not None:
            given["position"] = at
        made = make(table, label, **given)
        for name in names(made) if names is not None else ():
            self._take_name(name, label)
        self.material(given["material"])
        getattr(self._tree, table.section).append(made)
        return made

    def _take_name(self, name: str, label: str) -> None:
        if self._names is None or name in self._names:
            tables = (table for section in WALLS for table in getattr(self._tree, section))
            self._names = {name for table in tables for name in table.wall_names()}
            self._names |= {s.name for s in self._tree.sphere} | {c.name for c in self._tree.clump}
        if name in self._names:
            cause = f"there is already a sphere, clump or wall {quoted(name)}"
            raise ScenarioError([Problem(label, "name", cause, "give another name")])
        self._names.add(name)


def _own_name(table: Sphere | Clump) -> list[str]:
    return [table.name]
