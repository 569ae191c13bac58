"""Where the values of a study go: parameters of the scenario file, keys of `[run]`, numbers of balls and contact laws.

A key of `[set]` is one of these three, an expression of the study's parameters its value; a parameter of the study with
the name of such a key goes there by itself. Numbers of balls and laws, `cue.velocity.x` or `ball/cloth.friction`, cost
next to nothing per case (`carom.many.cases`); for the other two the scene is built anew.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from carom import units
from carom._core import Expression, ExpressionError
from carom.arrays import F64
from carom.errors import CaromError, Problem, did_you_mean, only_once, quoted
from carom.many.batch_result import KINEMATICS
from carom.many.cases import Overrides, refuse_numbers
from carom.scene.assembly import mesh_files
from carom.scene.assembly.triangles import Triangles
from carom.scene.scene import Scene
from carom.scene.tables import parameters
from carom.scene.tables.balls import Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.model import SINGLE, Contact
from carom.scene.toml.load import parse

#: What problems of options call their place; `named_in` puts the file of the study there.
RUN = "options of the study"
#: The same of options that vary from case to case.
VARIED = "parameters of the study"


#: Cases, spread over a study, of which one must be possible. More: what is wrong with all cases takes longer to be said.
MOST_TRIED = 50
#: Relative change (1) of a parameter by which it is seen what it sets.
NUDGE = 1e-3


@dataclass(frozen=True)
class Targets:
    """The expressions of a study, by what they set. `of_file`: parameters of the scenario file."""

    text: str
    source: str
    """What messages call the text."""
    folder: Path | None
    """Where files lie that the text names; None: in the present directory."""
    case: str | None
    run: Mapping[str, Any]
    points: Mapping[str, F64]
    base: Scene
    """The scene of the file as it stands."""
    of_file: Mapping[str, str]
    of_run: Mapping[str, str]
    of_arrays: Mapping[str, str]
    _found: dict[int, list[Problem]] = field(default_factory=dict, init=False, compare=False)
    """What cases that were validated are warned of."""

    @classmethod
    def of(
        cls,
        text: str,
        source: str,
        folder: Path | None,
        case: str | None,
        run: Mapping[str, Any],
        given: Mapping[str, str],
        points: Mapping[str, F64],
    ) -> Targets:
        """Sort the keys of `[set]`, and the parameters that need no `[set]`, by where they go."""
        known = _parameters(text)
        options = {key for name in ("run", "record") for key in SINGLE[name].model_fields}
        for key in run:
            if key not in options:
                raise CaromError(f"run.{key}: unknown key; {_cure(key, known, source)}")
        base = Scene._of(*parse(text, source, case, None, folder))
        base = base.overridden(run, dict.fromkeys(run, RUN)) if run else base
        used = {name for expression in given.values() for name in _variables(expression, points)}
        goes = {name for name in points if name in known or _option(name, options) or _is_array(name)}
        for name in points:
            if name not in goes | used:
                cure = did_you_mean(name, [*known, *(f"run.{key}" for key in sorted(options))])
                raise CaromError(
                    f"parameters.{name} goes nowhere: {source} has no parameter of this name ({cure}); name it in [set],"
                    f' as "cue.velocity.x" = "= {name}"'
                )
        rest = {name: name for name in points if name in goes}
        sorted_: tuple[list[tuple[str, str, str]], ...] = ([], [], [])
        for key, expression in {**rest, **given}.items():
            kind = 0 if key in known else 1 if _option(key, options) else 2
            place = key.removeprefix("run.").removeprefix("record.") if kind == 1 else key
            sorted_[kind].append((place, key, expression))
        return cls(text, source, folder, case, run, points, base, *map(only_once, sorted_))

    @property
    def expressions(self) -> dict[str, dict[str, str]]:
        """All of them, for the identity of a study."""
        return {"file": dict(self.of_file), "run": dict(self.of_run), "arrays": dict(self.of_arrays)}

    @property
    def surfaces(self) -> dict[tuple[str, bool], Triangles]:
        """Those of mesh files, which all cases have as they were when the study was read."""
        return {key: made for mesh in self.base._tree.mesh for key, made in mesh.read.items()}

    def check(self) -> None:
        """Refuse names and places that are wrong, and what is wrong with all cases, before anything is computed.

        An invalid value of one case is a row of its own, whichever case it is. So one case that can be built is enough.
        """
        if self.of_arrays:
            try:
                Overrides(self.base, {key: np.ones(1) for key in self.of_arrays})
            except CaromError as error:
                told = str(error).removeprefix("simulate_batch: ")
                raise CaromError(f"set: {told}") from error
        for key in self.of_run:
            if key in self.run:
                raise CaromError(
                    f"run.{key}: the study gives it twice, fixed and varied; leave out one of the two"
                )
        if self.base.run.until is None and "until" not in self.of_run:
            raise CaromError(
                "the scenario does not say how long to simulate; write until = TIME below [run] of the study"
            )
        cases = len(next(iter(self.points.values())))
        first: CaromError | None = None
        for case in np.unique(np.linspace(0, cases - 1, min(cases, MOST_TRIED)).astype(int)):
            try:
                self._validated(int(case))
            except CaromError as error:
                first = first or error
            else:
                self._check_effects(int(case))
                return
        if first is not None:
            raise first

    def advice(self) -> Iterator[str]:
        """What the first and the last case are warned of before they are computed: each place once."""
        told = set()
        for case in dict.fromkeys((0, len(next(iter(self.points.values()))) - 1)):
            try:
                found = self._validated(case)
            except CaromError:
                continue  # a row of its own
            for one in found:
                if (place := (one.where, one.line, one.key)) not in told:
                    told.add(place)
                    yield f"case {case}: {one}"

    def _validated(self, case: int) -> list[Problem]:
        if case not in self._found:
            self._found[case] = self.scene(case).validate()
        return self._found[case]

    def check_units(self, quantities: Mapping[str, str | None]) -> None:
        """Refuse values whose unit is of another dimension than a place that they go to unchanged."""
        for targets in (self.of_file, self.of_run, self.of_arrays):
            owners: list[type[Table]] = [*SINGLE.values()] if targets is self.of_run else [Sphere, Contact]
            for key, expression in targets.items():
                name = expression.strip().removeprefix("=").strip()
                if (text := quantities.get(name)) is None:
                    continue
                quantity = next((part for part in key.split(".")[::-1] if part not in tuple("wxyz")), "")
                owner = next((table for table in owners if quantity in table.model_fields), None)
                try:
                    if targets is self.of_file:
                        _, read = parameters.substitute(tomllib.loads(self.text), self.case, {key: text})
                        if read.found:
                            raise units.UnitError(read.found[0].cause, read.found[0].cure)
                    elif owner:
                        units.parse(text, parameters.dimension_of(owner, quantity))
                except units.UnitError as error:
                    raise CaromError(f"parameters.{name}: {error}") from error

    def _check_effects(self, case: int) -> None:
        """Refuse parameters of the file that do nothing: the study sets all that the file uses them for, and not by them."""
        if not (self.of_arrays or self.of_run or self.run):
            return
        fixed = {_sorted(key) for key in self.of_arrays}
        others = {**self.of_run, **self.of_arrays}.values()
        used = {name for text in others for name in _variables(text, self.points)}
        for name in (key for key in self.of_file if key not in used):
            changed = self._changed_by(name, case)
            if changed is None or changed - fixed:
                continue
            by = sorted(changed) or [f"run.{key}" for key in sorted({*self.run, *self.of_run})]
            what = "parameters" if name in self.points else "set"
            raise CaromError(
                f"{what}.{name} does nothing: the study sets what {self.source} uses it for ({', '.join(by)}); leave out"
                " one of the two"
            )

    def _changed_by(self, name: str, case: int) -> set[str] | None:
        """Balls' and laws' numbers that a parameter of the file changes; None: it changes others too, or that is unknown."""
        given = {key: float(v[0]) for key, v in self.values(self.of_file, range(case, case + 1)).items()}
        here = self._of_parameters(given, case)._tree.model_dump()
        for other in (given[name] * (1.0 + NUDGE) or NUDGE, given[name] + 1.0):
            try:
                there = self._of_parameters({**given, name: other}, case)._tree.model_dump()
            except CaromError:  # the file refuses the value, so it uses it
                return None
            if paths := list(_differing(here, there)):
                places = [_place(path, here) for path in paths]
                return None if None in places else {place for place in places if place is not None}
        return set()

    def values(self, expressions: Mapping[str, str], cases: range) -> dict[str, F64]:
        """Values of expressions at some points, (cases,) each."""
        found = {}
        for key, text in expressions.items():
            if text in self.points:
                found[key] = np.asarray(self.points[text][cases.start : cases.stop])
            else:
                found[key] = np.array([self._at(key, text, case) for case in cases])
        return found

    def _at(self, key: str, text: str, case: int) -> float:
        here = self.here(case)
        try:
            return float(_parsed(text).evaluate(here))
        except ValueError as error:
            told = ", ".join(f"{name} = {value:g}" for name, value in here.items())
            raise CaromError(
                f"set: {quoted(key)} = {quoted(text)} has no value at {told}: {error}"
            ) from error

    @property
    def fast(self) -> bool:
        """Whether all cases are arrays laid over one scene."""
        return not self.of_file and not self.of_run

    def scene(self, case: int) -> Scene:
        """The scene of a case, as it would be simulated by itself. What it holds may be that of `base`."""
        scene = read = self.of_text(case).overridden({}, {})
        if self.of_arrays:
            scene = Overrides(scene, self.values(self.of_arrays, range(case, case + 1))).scene(0)
        assert read._source is not None  # `parse` has made it
        scene._source = read._source.varied(self.here(case), is_text=not self.of_arrays)
        return scene

    def here(self, case: int) -> dict[str, float]:
        """The values of the study's parameters in a case."""
        return {name: float(values[case]) for name, values in self.points.items()}

    def possible(self, case: int) -> Scene:
        """The scene of a case as `of_text` makes it; refuses what `of_arrays` sets to where no scenario may be."""
        scene, one = self.of_text(case), range(case, case + 1)
        refuse_numbers(
            scene, {key: float(values[0]) for key, values in self.values(self.of_arrays, one).items()}
        )
        return scene

    def of_text(self, case: int) -> Scene:
        """The scene of a case without what `of_arrays` sets: no ball needs to be placed for it."""
        if self.fast:
            return self.base
        one = range(case, case + 1)
        return self._of_parameters(
            {key: float(values[0]) for key, values in self.values(self.of_file, one).items()}, case
        )

    def _of_parameters(self, parameters: Mapping[str, float], case: int) -> Scene:
        """The scene of the file with these values, and with the options of a case."""
        with mesh_files.kept(self.surfaces):
            scene = Scene._of(*parse(self.text, self.source, self.case, parameters, self.folder))
        varied = {k: _whole(float(v[0])) for k, v in self.values(self.of_run, range(case, case + 1)).items()}
        places = {**dict.fromkeys(self.run, RUN), **dict.fromkeys(varied, VARIED)}
        return scene.overridden({**self.run, **varied}, places) if places else scene


def _cure(key: str, parameters: list[str], source: str) -> str:
    """What to do with a key of no option below `[run]`."""
    if key in parameters:
        return f"it is a parameter of {source}: write it below [set], or below [parameters] if it varies"
    return did_you_mean(key, [*SINGLE["run"].model_fields, *SINGLE["record"].model_fields])


def _parameters(text: str) -> list[str]:
    return parameters.names(tomllib.loads(text))[0]


def _option(key: str, options: set[str]) -> bool:
    section, _, name = key.rpartition(".")
    return name in options and section in ("", "run", "record")


def _is_array(key: str) -> bool:
    return "." in key


def _whole(value: float) -> float | int:
    return int(value) if value.is_integer() else value


@cache
def _parsed(text: str) -> Any:
    try:
        return Expression(text.replace("=", " ", 1) if text.lstrip().startswith("=") else text)
    except ExpressionError as error:
        raise CaromError(f"set: cannot read {quoted(text)}: {error}") from error


def _variables(text: str, points: Mapping[str, F64]) -> list[str]:
    """The parameters of an expression, all of which must be of the study."""
    if text in points:
        return [text]
    names = list(_parsed(text).variables)
    for name in names:
        if name not in points:
            raise CaromError(
                f"set: unknown name {name} in {quoted(text)}; {did_you_mean(name, list(points))}"
            )
    return names


def _differing(a: Any, b: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where two trees of tables differ."""
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        for key in a:
            yield from _differing(a[key], b[key], (*path, key))
    elif isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)) and len(a) == len(b):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _differing(x, y, (*path, k))
    elif a is not b and a != b:
        yield path


def _place(path: tuple[Any, ...], tree: Mapping[str, Any]) -> str | None:
    """What `[set]` calls a number of a ball or a contact law; None for others."""
    match path:
        case ("contact", int(k), str(quantity)):
            return _sorted(f"{'/'.join(tree['contact'][k]['between'])}.{quantity}")
        case ("sphere", int(k), str(quantity)):
            return f"{tree['sphere'][k]['name']}.{quantity}"
        case ("sphere", int(k), str(quantity), int(axis)) if quantity in KINEMATICS:
            letters = "wxyz" if quantity == "orientation" else "xyz"
            return f"{tree['sphere'][k]['name']}.{quantity}.{letters[axis]}"
    return None


def _sorted(key: str) -> str:
    """A key of a contact law with its materials in one order; others as they are."""
    owner, _, quantity = key.rpartition(".")
    return f"{'/'.join(sorted(owner.split('/')))}.{quantity}"
