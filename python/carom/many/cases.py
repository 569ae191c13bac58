"""Cases of one scene: what differs between them, as arrays laid over those of the core.

The scene is resolved once. A case copies the few arrays that it changes and shares all others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64
from carom.errors import CaromError, ScenarioError, among, did_you_mean, quoted
from carom.numeric import reals
from carom.result.kinematics import QUANTITIES
from carom.scene.assembly.arrays import (
    COHESION,
    LAW_KEYS,
    VARYING,
    bodies,
    law_arrays,
    resolved_tree,
    with_packings_expanded,
    without_idle_cohesion,
)
from carom.scene.assembly.mechanics import joints_for_core, loads_for_core, numbers
from carom.scene.assembly.vectors import unit
from carom.scene.builders.balls import make
from carom.scene.checks.joint_start import check_start
from carom.scene.checks.rules import Whole
from carom.scene.scene import Scene
from carom.scene.tables.balls import Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.model import Contact

Values = ArrayLike
"""Numbers in SI, the first axis one row per case."""

WIDTHS = {name: len(letters) for name, (letters, _) in QUANTITIES.items()}
WIDTHS |= {"radius": 0, "mass": 0, "inertia": 0}
"""Quantities of balls, and how many components each has; 0 for a number."""


OFF_UNIT = 1e-6
"""By which the length of a quaternion may differ from 1, as in scenarios."""


@dataclass(frozen=True)
class _Place:
    """Where the values of a parameter go: `model[array][index]`."""

    array: str
    index: tuple[Any, ...]


class Overrides:
    """B cases of a scene. All names and shapes are checked at once; numbers are left to the core."""

    def __init__(
        self, scene: Scene, parameters: Mapping[str, Values], caller: str = "simulate_batch"
    ) -> None:
        self._scene, self._caller = scene, caller
        self._base = scene.to_model() | law_arrays(scene._tree)
        self._names = {name: i for i, name in enumerate(scene.names)}
        self._parts = {ball: clump.name for clump in scene.clumps for ball in clump.ball_names()}
        self._kappa = self._base["inertia"] / (self._base["mass"] * self._base["radius"] ** 2)
        tree = with_packings_expanded(scene._tree)
        self._start = bodies(tree)
        self._absent = ~self._start.present
        #: The tables, where joints and springs depend on the places of balls.
        self._mechanics = Whole.of(tree) if tree.joint or tree.spring else None
        self.values: dict[str, F64] = {}
        self._places: dict[str, _Place] = {}
        self.cases = 1
        for key, given in parameters.items():
            self._add(str(key), given)

    def _add(self, key: str, given: Values) -> None:
        place, shape = self._place(key)
        try:
            values = reals(given)
        except (TypeError, ValueError) as error:
            raise CaromError(f"{self._caller}: {quoted(key)} must be numbers in SI ({error})") from None
        if values.ndim == 0 or values.shape[1:] != shape:
            wanted = ", ".join(["B", *map(str, shape)]) + ("," if not shape else "")
            raise CaromError(
                f"{self._caller}: {quoted(key)} has shape {values.shape}, wanted ({wanted}), one row per case"
            )
        if self.values and len(values) != self.cases:
            first = next(iter(self.values))
            raise CaromError(
                f"{self._caller}: {quoted(key)} has {len(values)} rows and {quoted(first)} has {self.cases};"
                " give one row per case of each"
            )
        if len(values) == 0:
            raise CaromError(f"{self._caller}: {quoted(key)} has no rows; give one per case")
        for other, taken in self._places.items():
            if taken.array == place.array and _meet(taken.index, place.index):
                raise CaromError(
                    f"{self._caller}: {quoted(key)} and {quoted(other)} both give the same numbers"
                )
        self.cases = len(values)
        self.values[key], self._places[key] = values, place

    def _place(self, key: str) -> tuple[_Place, tuple[int, ...]]:
        """Where a key points, and the shape of one case's values."""
        if key == "gravity":
            return _Place("gravity", ()), (3,)
        if key in WIDTHS:
            if self._parts:
                raise CaromError(
                    f"{self._caller}: {quoted(key)} of all balls: the scene has clumps, whose balls move as one;"
                    f' name the spheres one by one, as "cue.{key}"'
                )
            if key in QUANTITIES and self._absent.any():
                raise CaromError(
                    f"{self._caller}: {quoted(key)} of all balls: those of inflows enter where and as their table says;"
                    f' name the spheres one by one, as "cue.{key}"'
                )
            width = WIDTHS[key]
            return _Place(key, ()), (len(self._names), *([width] if width else []))
        owner, _, quantity = key.rpartition(".")
        if quantity in ("w", "x", "y", "z") and owner:
            letters = quantity
            owner, _, quantity = owner.rpartition(".")
            width = WIDTHS.get(quantity, 0)
            axes = "wxyz" if width == 4 else "xyz"
            if key == f"gravity.{letters}" and letters in axes:
                return _Place("gravity", (axes.index(letters),)), ()
            if not width or letters not in axes:
                raise CaromError(f"{self._caller}: {quoted(key)}: {quoted(quantity)} has no {letters}")
            return _Place(quantity, (self._body(key, owner, quantity), axes.index(letters))), ()
        if "/" in owner and (quantity in LAW_KEYS or owner not in self._names):
            return self._law(key, owner, quantity), ()
        if quantity not in WIDTHS:
            known = [*WIDTHS, "gravity"]
            raise CaromError(
                f"{self._caller}: {quoted(key)} names no quantity; {did_you_mean(quantity or key, known)};"
                ' write "velocity", "cue.velocity", "cue.velocity.x" or "ball/cloth.friction"'
            )
        width = WIDTHS[quantity]
        return _Place(quantity, (self._body(key, owner, quantity),)), ((width,) if width else ())

    def _body(self, key: str, owner: str, quantity: str) -> int:
        if owner not in self._names:
            cure = among(owner, list(self._names))
            raise CaromError(f"{self._caller}: {quoted(key)}: no ball is called {quoted(owner)}; {cure}")
        if owner in self._parts:
            raise CaromError(
                f"{self._caller}: {quoted(key)}: {quoted(owner)} is a part of clump {quoted(self._parts[owner])};"
                " make a scene for each case, or give the file [parameters]"
            )
        number = self._names[owner]
        if quantity in QUANTITIES and self._absent[number]:
            raise CaromError(
                f"{self._caller}: {quoted(key)}: {quoted(owner)} is of an inflow and enters where and as its table says;"
                " make a scene for each case, or give the file [parameters]"
            )
        return number

    def _law(self, key: str, owner: str, quantity: str) -> _Place:
        pair = set(owner.split("/", 1))
        laws = [set(law.between) for law in self._scene._tree.contact]
        if pair not in laws:
            cure = did_you_mean(owner, ["/".join(law.between) for law in self._scene._tree.contact])
            raise CaromError(f"{self._caller}: {quoted(key)}: no contact law of {quoted(owner)}; {cure}")
        if quantity not in LAW_KEYS:
            raise CaromError(f"{self._caller}: {quoted(key)}: {did_you_mean(quantity, LAW_KEYS)}")
        return _Place(quantity, (laws.index(pair),))

    def model(self, case: int) -> dict[str, Any]:
        """The argument of the core for one case."""
        model = self._laid_over(case)
        placed = {place.array for place in self._places.values()} & {*QUANTITIES, "radius"}
        if self._mechanics is not None and placed:
            self._join(model, {key: model[key] for key in placed})
        return without_idle_cohesion(model)

    def _join(self, model: dict[str, Any], placed: Mapping[str, Any]) -> None:
        """Joints and loads of balls that have been `placed`, as of a scene of them: refused where that scene would be."""
        assert self._mechanics is not None
        start = replace(self._start, **placed)
        if wrong := list(check_start(replace(self._mechanics, _bodies=start))):
            raise ScenarioError(self._scene._problem(finding) for finding in wrong)
        tree, number = self._scene._tree, numbers(start)
        if tree.joint:
            model["joints"] = joints_for_core(tree.joint, start, number)
        if "loads" in model:
            model["loads"] = loads_for_core(
                tree.load, tree.spring, tree.drag, tree.load_function, start, number
            )

    def _laid_over(self, case: int) -> dict[str, Any]:
        """The same, with the numbers of all laws."""
        model = dict(self._base)
        touched: set[str] = set()
        for key, place in self._places.items():
            if place.array not in touched:
                model[place.array] = model[place.array].copy()
                touched.add(place.array)
            model[place.array][place.index] = self.values[key][case]
            if place.array in VARYING and (name := f"{place.array}_law") in model:
                laws = list(model[name])
                laws[place.index[0]] = None  # the number takes the place of the law
                model[name] = laws
        if touched & {"mass", "radius"}:
            self._inertia(model)
        if "orientation" in touched:
            model["orientation"] = self._turned(model["orientation"])
        return model

    def _turned(self, q: F64) -> F64:
        """Unit quaternions (N, 4): those that are given whole must be ones, others that are given a component follow it."""
        whole, touched = np.zeros((2, len(q)), dtype=bool)
        for place in self._places.values():
            if place.array == "orientation":
                touched[place.index[:1]] = True
                whole[place.index[:1]] |= len(place.index) < 2
        rows = np.flatnonzero(touched)
        length = np.linalg.norm(q[rows], axis=1)
        off = np.where(whole[rows], ~(np.abs(length - 1.0) <= OFF_UNIT), length == 0.0)
        for wrong in np.flatnonzero(off):
            ball = quoted(self._scene.names[rows[wrong]])
            raise CaromError(
                f"orientation of {ball}: a unit quaternion has length 1, found {length[wrong]:.9g}"
            )
        q[rows] = [unit(row) for row in q[rows].tolist()]
        return q

    def _inertia(self, model: dict[str, Any]) -> None:
        """I / (m r^2) stays, where mass or radius changed and the moment of inertia was not given itself."""
        changed = (model["mass"] != self._base["mass"]) | (model["radius"] != self._base["radius"])
        for place in self._places.values():
            if place.array == "inertia":
                changed[place.index[0] if place.index else slice(None)] = False
        scaled = self._kappa * model["mass"] * model["radius"] ** 2
        model["inertia"] = np.where(changed, scaled, model["inertia"])

    def scene(self, case: int) -> Scene:
        """One case as a scene of its own, with every number of its spheres, and of those of generators (up to 10 000)."""
        model, tree = self._laid_over(case), resolved_tree(self._scene._tree)
        for key, place in self._places.items():
            last = place.index[0] if place.index else len(self._names) - 1
            if place.array in WIDTHS and last >= len(tree.sphere):
                cure = "make a scene for each case, or give the file [parameters]"
                raise CaromError(
                    f"{quoted(key)}: {quoted(self._scene.names[last])} is no sphere of a scene; {cure}"
                )
        spheres = [
            sphere.model_copy(
                update={
                    **{key: tuple(model[key][i].tolist()) for key, width in WIDTHS.items() if width},
                    **{key: float(model[key][i]) for key, width in WIDTHS.items() if not width},
                    "density": None,
                }
            )
            for i, sphere in enumerate(tree.sphere)
        ]
        changed = {
            (place.array, place.index[0]) for place in self._places.values() if place.array in LAW_KEYS
        }
        # A table has both of cohesion, or none.
        changed |= {(key, i) for of, i in changed if of in COHESION for key in COHESION}
        laws = [
            law.model_copy(update={key: float(model[key][i]) for key in LAW_KEYS if (key, i) in changed})
            for i, law in enumerate(tree.contact)
        ]
        world = tree.world.model_copy(update={"gravity": tuple(model["gravity"].tolist())})
        return Scene._of(tree.model_copy(update={"sphere": spheres, "contact": laws, "world": world}))


def refuse_numbers(scene: Scene, values: Mapping[str, float]) -> None:
    """Raise `ScenarioError` for sizes, masses and numbers of laws that no scenario may have; names are those of `Overrides`,
    which leaves them to the core. Nothing is placed for it.
    """
    pairs = [set(law.between) for law in scene._tree.contact]
    of_laws: dict[int, dict[str, str]] = {}
    for key, value in values.items():
        owner, _, quantity = key.rpartition(".")
        pair = set(owner.split("/", 1))
        if pair in pairs and quantity in LAW_KEYS:
            of_laws.setdefault(pairs.index(pair), {})[quantity] = key
        elif quantity in ("radius", "mass", "inertia"):
            _refused(Sphere, {**_ANY_BALL, quantity: value}, {quantity: key})
    for i, keys in of_laws.items():  # numbers of a law may ask for one another
        given = {quantity: values[key] for quantity, key in keys.items()}
        _refused(Contact, {**scene._tree.contact[i].written(), **given}, keys)


def _refused(table: type[Table], given: Mapping[str, Any], keys: Mapping[str, str]) -> None:
    """Raise `ScenarioError` if a table may not be so; problems name the `keys` that set it."""
    first = next(iter(keys.values()))
    try:
        make(table, "", **given)
    except ScenarioError as error:
        raise ScenarioError(
            replace(p, where="set", key=keys.get(p.key, first)) for p in error.problems
        ) from None


_ANY_BALL = {"name": "x", "material": "x", "position": (0.0, 0.0, 0.0), "radius": 1.0, "mass": 1.0}


def _meet(a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether two indices share an element: the shorter one is the beginning of the longer."""
    return all(x == y for x, y in zip(a, b, strict=False))
