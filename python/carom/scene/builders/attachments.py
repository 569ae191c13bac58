"""`Attacher`: the calls of a `carom.Scene` that add joints and loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from carom.arrays import F64
from carom.errors import Problem, ScenarioError, quoted
from carom.scene.arguments import explained
from carom.scene.builders.balls import Number, Vector, make
from carom.scene.tables.joints import Joint, default_name
from carom.scene.tables.loads import Drag, Load, LoadFunction, Spring
from carom.scene.tables.model import Scenario

Law = Number | Mapping[str, Any]
"""A number, a string with a unit, a formula as "20*t", or `{"polynomial": [...]}`, `{"table": [...]}`."""
LoadCallable = Callable[[float, F64, F64, F64], Any]


class Attacher:
    """Joints, forces, springs, drag; the bodies are named, also those of racks and lattices."""

    _tree: Scenario

    @explained
    def joint(
        self,
        type: str,
        *,
        name: str | None = None,
        body: str | None = None,
        between: Sequence[str] | None = None,
        point: Vector | None = None,
        points: Sequence[Vector] | None = None,
        direction: Vector | None = None,
        normal: Vector | None = None,
        axes: Sequence[Vector] | None = None,
        axis: Vector | None = None,
        length: Law | None = None,
        displacement: Law | None = None,
        angle: Law | None = None,
    ) -> Joint:
        """Join a sphere to the ground (`body`) or two partners (`between`; one may be "ground").

        - "fix" (`body`; `point`): that point of the body, by default the centre, stays where it is
        - "line" (`body`, `direction`; `point`), "plane" (`body`, `normal`; `point`): it moves along a line, in a plane
        - "lock" (`body` or `between`; `axes`): no rotation about these fixed axes, by default about none
        - "ball" (`between`, `point`): the bodies share that point
        - "rod" (`between`; `points`, `length`): the distance of two points, by default the centres, is given
        - "motion" (`body`; `direction`, `displacement` or `axis`, `angle`): follows a law of the time `t`, from the start

        Points are those at the start, m, in fixed axes, carried by their bodies; `length` and `displacement` m, `angle` rad.
        """
        given = {k: v for k, v in locals().items() if k != "self"}
        joint = make(Joint, f"Scene.joint({quoted(type)})", **given)
        self._tree.joint.append(joint)
        return joint

    @explained
    def load(
        self, on: str, *, force: Sequence[Law] | None = None, torque: Sequence[Law] | None = None
    ) -> Load:
        """Push the sphere `on`: `force` N at its centre and `torque` N m, in fixed axes.

        Each component is a number or a law of the time, as `force=(0, 0, "20*t")`.
        """
        load = make(Load, f"Scene.load({quoted(on)})", on=on, force=force, torque=torque)
        self._tree.load.append(load)
        return load

    @explained
    def spring(
        self,
        a: str,
        b: str,
        *,
        points: Sequence[Vector] | None = None,
        stiffness: Number | None = None,
        damping: Number | None = None,
        rest_length: Number | None = None,
    ) -> Spring:
        """A linear spring (`stiffness` N/m) and damper (`damping` N s/m) between two spheres, or one and "ground".

        `points` are its ends at the start, m, by default the centres; that of the ground must be given. `rest_length` m,
        by default the length at the start.
        """
        label = f"Scene.spring({quoted(a)}, {quoted(b)})"
        given = {k: v for k, v in locals().items() if k not in ("self", "a", "b", "label")}
        spring = make(Spring, label, between=(a, b), **given)
        self._tree.spring.append(spring)
        return spring

    @explained
    def drag(self, on: str, *, translation: Number | None = None, rotation: Number | None = None) -> Drag:
        """Viscous drag on a sphere, or on "all": force `-translation v` (N s/m), torque `-rotation w` (N m s)."""
        drag = make(Drag, f"Scene.drag({quoted(on)})", on=on, translation=translation, rotation=rotation)
        self._tree.drag.append(drag)
        return drag

    @explained
    def load_function(self, function: LoadCallable | object, *, name: str | None = None) -> LoadFunction:
        """Loads from Python: `function(t, position, velocity, angular_velocity)` gives force and torque, (N, 6).

        It gets the time (s) and arrays (N, 3) in the order of `scene.names`, and returns forces (N) and torques (N m)
        in fixed axes. It must depend on nothing else: the step may call it several times. A file cannot hold it:
        `to_toml` refuses, and `carom.resume` asks for it again. `name` is by default that of the function.
        """
        label = "Scene.load_function"
        if not callable(function):
            cause = f"expected a function, found {quoted(function)}"
            cure = "pass f(t, position, velocity, angular_velocity) that returns an array (N, 6)"
            raise ScenarioError([Problem(label, "", cause, cure)])
        known = {place.name: place for place in self._tree.load_function}
        own = getattr(function, "__name__", "")
        name = name or (own if own.isidentifier() else f"function{len(known) + 1}")
        place = known.get(name)
        if place is None:
            place = make(LoadFunction, label, name=name)
            self._tree.load_function.append(place)
        elif place.function is not None:
            cause = f"there is already a load function {quoted(name)}"
            raise ScenarioError([Problem(label, "name", cause, "give another one: name=...")])
        place._function = function
        return place

    @property
    def load_functions(self) -> tuple[LoadFunction, ...]:
        """The Python functions, each with its name and `function`; None where a file told the name alone."""
        return tuple(self._tree.load_function)

    @property
    def joint_names(self) -> list[str]:
        """Names of all joints, in their order."""
        return [joint.name or default_name(i) for i, joint in enumerate(self._tree.joint)]
