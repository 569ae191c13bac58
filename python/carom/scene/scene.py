"""`carom.Scene`: a scenario as a Python object.

A scene and a scenario file are the same tree (`carom.scene.tables.model`), and each converts into the other
without loss. Lengths and all other quantities are numbers in SI, or strings with a unit: `radius="28.575
mm"`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, Unpack

from carom.errors import CaromError, Problem, ScenarioError, counted, quoted
from carom.files import reason, write_named
from carom.scene.arguments import explained, renamed, wording
from carom.scene.assembly.arrays import resolved_tree, to_arrays, walls, with_packings_expanded
from carom.scene.assembly.mechanics import MECHANICS
from carom.scene.assembly.placing import Placed
from carom.scene.attributes import is_settable, refusal
from carom.scene.builders.attachments import Attacher
from carom.scene.builders.balls import Number, Vector, make, own
from carom.scene.builders.from_run import Taker
from carom.scene.builders.walls import Waller
from carom.scene.builders.world import Deformer
from carom.scene.checks.advice import advise
from carom.scene.checks.rules import Whole, check, steps
from carom.scene.messages import Finding, Source
from carom.scene.notebook import of_scene
from carom.scene.tables.balls import Generator, Sphere
from carom.scene.tables.billiard import BilliardTable
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow
from carom.scene.tables.joints import Joint
from carom.scene.tables.loads import LoadFunction, Spring
from carom.scene.tables.model import FORMAT, Contact, Material, Record, Scenario, World
from carom.scene.tables.options import Run
from carom.scene.tables.packing import Packing, Places, advise_packings, faults
from carom.scene.tables.walls import PLANE, WALLS, Plane
from carom.scene.toml import load
from carom.scene.toml.dump import to_text

if TYPE_CHECKING:
    from carom.scene.tables.keywords import Options


class Scene(Waller, Attacher, Taker, Deformer):
    """Spheres, walls, materials and how to simulate them.

    `scene.world`, `scene.run` and `scene.record` hold the keys of `[world]`, `[run]` and `[record]` as attributes:
    `scene.run.step = 1e-4`. Values are checked as they are given; `validate` checks the scene as a whole. Whatever is wrong
    raises `carom.ScenarioError`.
    """

    @explained
    def __init__(
        self,
        title: str = "",
        *,
        gravity: Vector = (0.0, 0.0, -9.8),
        periodic: Sequence[Number] | None = None,
        origin: Vector | None = None,
        run: Mapping[str, Any] | None = None,
        record: Mapping[str, Any] | None = None,
    ) -> None:
        given: dict[str, Any] = {"title": title} if title else {}
        self._tree: Scenario = make(
            Scenario,
            "Scene",
            format=FORMAT,
            world=make(World, "Scene", gravity=gravity, periodic=periodic, origin=origin),
            run=make(Run, "Scene(run=...)", **(run or {})),
            record=make(Record, "Scene(record=...)", **(record or {})),
            **given,
        )
        self._source: Source | None = None
        self._places: dict[str, str] = {}  # keys of [run] and [record] that were overridden, and by what
        self._names = None

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse what nothing would read. Subclasses may have attributes of their own."""
        if type(self) is Scene and not name.startswith("_") and not is_settable(Scene, name):
            raise refusal(Scene, name)
        super().__setattr__(name, value)

    # --- reading and writing --------------------------------------------------------------------------------

    @classmethod
    @renamed
    def from_toml(
        cls, source: str | Path, *, case: str | None = None, parameters: Mapping[str, Any] | None = None
    ) -> Scene:
        """The scene of a scenario file, or of TOML text (a `str` that is empty or has a line break).

        Of a file with `[parameters]`, `case` names one of its variants and `parameters` gives other values,
        numbers in SI or expressions (`{"f": 0.3, "phi": "= asin(1 - f)"}`), which go before those of the case.

        All mistakes in the keys and values are reported at once, with file and line. A scene that can be read
        may still be impossible to simulate (spheres that overlap, a missing contact law): `validate` tells.
        """
        if isinstance(source, str) and (not source or "\n" in source):
            tree, origin = load.parse(source, case=case, given=parameters)
        else:
            tree, origin = load.read(source, case, parameters)
        return cls._of(tree, origin)

    @classmethod
    def _of(cls, tree: Scenario, source: Source | None = None) -> Scene:
        scene = cls.__new__(cls)
        scene._tree, scene._source, scene._places, scene._names = tree, source, {}, None
        return scene

    def __copy__(self) -> Self:
        """A scene of its own: what is done to one does nothing to the other."""
        scene = self.__class__.__new__(self.__class__)
        scene.__dict__ |= {
            **self.__dict__,
            "_tree": own(self._tree),
            "_places": {**self._places},
            "_names": None,
        }
        return scene

    def to_toml(self, path: str | Path | None = None, *, resolved: bool = False) -> str:
        """The scene as TOML text, also written to `path` if given. `Scene.from_toml` of it equals this scene.

        Files of meshes are named as seen from the place of `path`; without it from the root on.
        With `resolved` nothing is left to defaults or to chance: every key has its value and packings, racks and
        lattices are written as the spheres they stand for (unless these are more than 10 000). A run
        directory holds this form.

        Python functions cannot be written, so a scene that has some is refused. The resolved form holds their names and is
        no scenario that could be run: it waits for the functions (see `load_function`).
        """
        functions = [place for place in self._tree.load_function if place.function is not None]
        if functions and not resolved:
            cure = "write laws of the time with scene.load(...), or keep the scene as a Python program"
            raise ScenarioError(
                Problem(place.label(), "", "a file cannot hold a Python function", cure)
                for place in functions
            )
        folder = None if path is None else Path(path).parent
        text = to_text(
            resolved_tree(self._tree) if resolved else self._tree, everything=resolved, folder=folder
        )
        if path is not None:
            try:
                write_named(Path(path), text.encode())
            except CaromError:
                raise
            except ValueError as error:  # a null byte in the name, half a character in a text
                raise CaromError(f"cannot write {path}: {reason(error)}") from error
        return text

    def resolved(self) -> Scene:
        """A copy that nothing done to this scene changes, with nothing left to defaults or to chance: `Result.scene`."""
        return Scene._of(own(resolved_tree(self._tree)))

    def _without_functions(self) -> Scene:
        """This scene as a file has it: with the names of its Python functions alone."""
        places = [LoadFunction(name=place.name) for place in self._tree.load_function]
        return Scene._of(self._tree.model_copy(update={"load_function": places}))

    # --- settings -------------------------------------------------------------------------------------------

    @property
    def title(self) -> str:
        return self._tree.title

    @title.setter
    def title(self, value: str) -> None:
        self._tree.title = value

    @property
    def case(self) -> str | None:
        """Name of the case of the file that the scene was read from, if it is one."""
        return self._source.case if self._source else None

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of the file that the scene was read from, SI, and of those of `study` that it has not."""
        return {**self.study, **self._source.parameters} if self._source else {}

    @property
    def study(self) -> dict[str, float]:
        """Values of the parameters of the study whose case the scene is: a name may be one of the file's as well."""
        return dict(self._source.study) if self._source else {}

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity, m/s^2."""
        return self._tree.world.gravity

    @gravity.setter
    def gravity(self, value: Vector) -> None:
        self._tree.world.gravity = value  # type: ignore[assignment]  # converted by the model

    @property
    def periodic(self) -> tuple[float, float, float] | None:
        """Periods of the world along x, y, z, m, 0 where it has none; None if it has none at all."""
        return self._tree.world.periodic

    @periodic.setter
    def periodic(self, value: Sequence[Number] | None) -> None:
        self._tree.world.periodic = value  # type: ignore[assignment]  # converted by the model

    @property
    def billiard_table(self) -> BilliardTable | None:
        """Measures of the table of the billiards kit that this scene is, for pictures; None of any other scene."""
        return self._tree.billiard_table

    @billiard_table.setter
    def billiard_table(self, value: Mapping[str, Any] | BilliardTable | None) -> None:
        given = make(BilliardTable, "scene.billiard_table", **value) if isinstance(value, Mapping) else value
        self._tree.billiard_table = given

    @property
    def world(self) -> World:
        """What acts on all bodies: the keys of `[world]`. (Joints and springs call what stands still "ground".)"""
        return self._tree.world

    @property
    def run(self) -> Run:
        """How to compute: the keys of `[run]`."""
        return self._tree.run

    @property
    def record(self) -> Record:
        """What to keep: the keys of `[record]`."""
        return self._tree.record

    def with_options(self, **options: Unpack[Options]) -> Scene:
        """A copy with other keys of `[run]` and `[record]`; nothing that is done to it changes this scene."""
        return copy(self).overridden(options, dict.fromkeys(options, "carom.simulate"))

    def overridden(
        self, options: Mapping[str, Any], places: Mapping[str, str], own: Iterable[str] = ()
    ) -> Scene:
        """As `with_options`, but spheres and everything else are shared: of a scene that nobody edits. `places` says what
        messages call the origin of each key, as `--set step`, and `own` what the caller takes besides.
        """
        options = dict(options)
        tree = self._tree.model_copy()
        for section in (tree.run, tree.record):
            mine = {key: options.pop(key) for key in list(options) if key in type(section).model_fields}
            kept = {key: value for key, value in section.written().items() if key not in mine}
            try:
                setattr(tree, section.section, make(type(section), "", **kept, **mine))
            except ScenarioError as error:
                wrong = (_placed(p.key, p.cause, p.cure, places) for p in error.problems)
                raise ScenarioError(wrong) from None
        if options:
            known = [*type(tree.run).model_fields, *type(tree.record).model_fields, *own]
            raise ScenarioError(
                _placed(key, "unknown option", wording(key, known), places) for key in options
            )
        scene = Scene._of(tree, self._source)
        scene._places = {**self._places, **places}
        return scene

    # --- the whole ------------------------------------------------------------------------------------------

    @property
    def names(self) -> list[str]:
        """Names of all balls in the order of the arrays: spheres, packings, racks, lattices, clumps, inflows."""
        generated = (g.ball_names() for g in self._generators())
        return [*(s.name for s in self._tree.sphere), *(name for names in generated for name in names)]

    @property
    def wall_names(self) -> list[str]:
        """Names of all walls, in the order of the core: planes without end first, then the others."""
        return [wall.name for wall in self._walls()]

    @property
    def plane_names(self) -> list[str]:
        """Names of the planes without end, among them sides of boxes."""
        return [wall.name for wall in self._walls() if wall.kind == PLANE]

    @property
    def spheres(self) -> tuple[Sphere, ...]:
        """The single balls (without those of packings, racks and lattices)."""
        return tuple(self._tree.sphere)

    @property
    def planes(self) -> tuple[Plane, ...]:
        """The tables `[[plane]]`."""
        return tuple(self._tree.plane)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The tables `[[material]]`, in the order of `Result.bodies["material"]`."""
        return tuple(self._tree.material)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contact laws, tables `[[contact]]`."""
        return tuple(self._tree.contact)

    @property
    def clumps(self) -> tuple[Clump, ...]:
        """The rigid bodies made of spheres: tables `[[clump]]`, then those of inflows."""
        return tuple(self._tree.clumps())

    @property
    def inflows(self) -> tuple[Inflow, ...]:
        """The tables `[[inflow]]`."""
        return tuple(self._tree.inflow)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The tables `[[joint]]`; all their names, given or not, are `joint_names`."""
        return tuple(self._tree.joint)

    @property
    def springs(self) -> tuple[Spring, ...]:
        """The tables `[[spring]]`."""
        return tuple(self._tree.spring)

    def _walls(self) -> list[Placed]:
        return walls(self._tree)

    def _generators(self) -> list[Generator | Packing | Clump | Inflow]:
        tree = self._tree
        return [*tree.packing, *tree.rack, *tree.lattice, *tree.clump, *tree.inflow]

    def validate(self) -> list[Problem]:
        """Check the scene as a whole. Returns warnings with advice; raises `ScenarioError` with all errors at once."""
        return self._judged(check)

    def _advice(self, advice: Callable[[Whole], Iterable[Finding]] = advise) -> list[Problem]:
        """The warnings of `validate`, or others, where no errors are looked for.

        The scene of a finished run had none. Its file lacks the Python functions, which advice does not need.
        """
        return self._judged(lambda parts: (), advice)

    def _judged(
        self,
        rules: Callable[[Whole], Iterable[Finding]],
        advice: Callable[[Whole], Iterable[Finding]] = advise,
    ) -> list[Problem]:
        wrong, good = faults(self._tree.packing)
        tree = self._tree.model_copy(update={"packing": list(good.values())})
        parts = replace(
            Whole.of(with_packings_expanded(tree)), damaged=frozenset(["sphere"] if wrong else [])
        )
        place = Places(len(tree.sphere), good)
        wrong += place.found(rules(parts))
        if wrong:
            raise ScenarioError(self._problem(f) for f in wrong)
        told = place.found(advice(parts))
        return [self._problem(f) for f in (*told, *advise_packings(good))]

    def _problem(self, finding: Finding) -> Problem:
        """A finding with its place: the line of the file, or the call that made the table."""
        path = finding.path
        if path[0] in ("run", "record") and path[-1] in self._places:
            return _placed(str(path[-1]), finding.cause, finding.cure, self._places)
        if self._source is not None and self._source.holds(path):
            return self._source.problem(finding)
        section = str(path[0])
        cure = finding.call or finding.cure
        if (
            len(path) > 1
            and isinstance(path[1], int)
            and (len(path) > 2 or section in (*MECHANICS, *WALLS, "outlet"))
        ):
            table = getattr(self._tree, section)[path[1]]
            return Problem(table.label(), str(path[2]) if len(path) > 2 else "", finding.cause, cure)
        key = section if section not in ("run", "record") else ".".join(map(str, path))
        return Problem("scene", key if section != "material" else "contact", finding.cause, cure)

    def to_model(self) -> dict[str, Any]:
        """The arrays for `carom._core.Simulation` (their names, units and shapes are in `_core.pyi`)."""
        arrays = to_arrays(self._tree)
        if arrays is None:
            self.validate()  # raises and says which material, sphere or function is unknown
            raise AssertionError("a valid scene has arrays")
        return arrays

    def __eq__(self, other: object) -> bool:
        """Whether both say the same: all values, given or by default, the points of meshes wherever their files lie."""
        return isinstance(other, Scene) and self._said() == other._said()

    def _said(self) -> tuple[dict[str, Any], list[Any]]:
        tree = self._tree.model_copy(update={"mesh": [mesh.resolved() for mesh in self._tree.mesh]})
        return tree.model_dump(), [place.function for place in tree.load_function]

    __hash__ = None  # type: ignore[assignment]  # a scene can be changed

    def __repr__(self) -> str:
        run = self.run
        tree = self._tree
        loads = [*tree.load, *tree.spring, *tree.drag, *tree.load_function]
        counts = ", ".join(
            counted(n, what)
            for n, what, always in (
                (len(self.names), "sphere", True),
                (len(tree.clumps()), "clump", False),
                (len(self.plane_names), "plane", True),
                (len(self.wall_names) - len(self.plane_names), "other wall", False),
                (len(tree.contact), "contact law", True),
                (len(tree.joint), "joint", False),
                (len(loads), "load", False),
            )
            if n or always
        )
        time = (
            f"{counted(steps(run), 'step')} of {run.step:g} s"
            if run.until is not None
            else f"step {run.step:g} s, no end yet"
        )
        return f"<Scene {quoted(self.title)}: {counts}; {time}>"

    def _repr_html_(self) -> str:
        return of_scene(self)


def _placed(key: str, cause: str, cure: str, places: Mapping[str, str]) -> Problem:
    place = places.get(key, "carom.simulate")
    return Problem(place, "" if place.startswith("-") else key, cause, cure)
