"""What a study is: a scenario, what varies in it, how points are chosen, what is kept. As a file, or in Python."""

from __future__ import annotations

import hashlib
import inspect
import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from carom.arrays import F64
from carom.errors import CaromError, ScenarioError, among, did_you_mean
from carom.many.batch_result import KINEMATICS
from carom.many.sweep.design import Axis, Design, number, with_unit
from carom.many.sweep.origin import COLUMNS as ORIGIN
from carom.many.sweep.table_file import read_table
from carom.many.sweep.targets import RUN, Targets
from carom.many.threads import ENERGIES, MONITORS
from carom.result.kinematics import QUANTITIES
from carom.run.result import Result
from carom.run.summary import LISTED_BODIES
from carom.scene.scene import Scene
from carom.scene.shipped import find, named
from carom.scene.tables.model import SINGLE
from carom.scene.toml.lines import LineMap
from carom.scene.toml.load import read_text

Measure = Callable[["Result"], Mapping[str, float]]

FORMAT = 1
#: Columns that are no parameters.
RESERVED = (
    "case",
    "id",
    "outcome",
    "message",
    "time",
    "seconds",
    *ORIGIN,
    *MONITORS,
    *(f"energy_{name}" for name in ENERGIES),
)
KEYS = {
    "": ("format", "title", "scenario", "case", "parameters", "design", "set", "run", "keep"),
    "design": ("kind", "count", "seed", "file"),
    "keep": ("runs", "bodies"),
}


@dataclass(frozen=True)
class Study:
    """A scenario with parameters that vary. Made by `Study.of`, or `Study.from_toml`."""

    text: str
    """The scenario, TOML."""
    axes: tuple[Axis, ...]
    design: Design = field(default_factory=Design)
    targets: Mapping[str, str] = field(default_factory=dict)
    """Where values go: key of the scene (see `carom.many.sweep.targets`) to an expression of the parameters."""
    run: Mapping[str, Any] = field(default_factory=dict)
    """Keys of `[run]` and `[record]` for all cases."""
    case: str | None = None
    title: str = ""
    source: str = "scenario"
    """What messages call the scenario."""
    folder: Path | None = None
    """Where files lie that the scenario names, such as meshes; None: in the present directory."""
    keep_runs: bool = False
    bodies: tuple[str, ...] | None = None
    """Balls whose final state is kept; None: all, unless there are more than 100."""
    measure: Measure | None = None
    """Gives further columns from the `Result` of a case."""

    @classmethod
    def of(
        cls,
        scene: Scene | str | Path,
        parameters: Mapping[str, Any] | None = None,
        *,
        design: str = "grid",
        count: int | None = None,
        seed: int = 0,
        table: Mapping[str, Sequence[float | str]] | str | Path | None = None,
        set: Mapping[str, str | float] | None = None,
        case: str | None = None,
        title: str = "",
        keep_runs: bool = False,
        bodies: Sequence[str] | None = None,
        measure: Measure | None = None,
        check: bool = True,
        **options: Any,
    ) -> Study:
        """A study in Python; the arguments are the keys of a file, `options` those of `[run]`. `scene` may be the name of
        an example that comes with Carom, too.

        `Study.of("break.toml", {"v": (5.0, 12.0), "mu": [0.1, 0.2]}, design="sobol", count=1000)`: a pair is a range, a list
        all its values. `set` says where values go: `{"cue.velocity.x": "= v*cos(aim)"}`. Without `check` what cannot be
        computed is refused later, by `study.check()`.
        """
        folder = None
        if isinstance(scene, Scene):
            text, source = scene.to_toml(), "scene"
        else:
            path = _example_or(Path(scene))
            text, source, folder = _read(path), str(scene), path.absolute().parent
            Scene.from_toml(path, case=case)  # what is wrong with it is said with its lines
        columns = read_table(Path(table)).columns if isinstance(table, (str, Path)) else table
        study = cls(
            text=text,
            axes=tuple(Axis.of(name, given) for name, given in (parameters or {}).items()),
            design=Design("table" if table is not None else design, count, seed, columns),
            targets={
                key: value if isinstance(value, str) else repr(number(f"set.{key}", value))
                for key, value in (set or {}).items()
            },
            run=options,
            case=case,
            title=title,
            source=source,
            folder=folder,
            keep_runs=keep_runs,
            bodies=None if bodies is None else (bodies,) if isinstance(bodies, str) else tuple(bodies),
            measure=measure,
        )
        if check:
            study.check()
        return study

    @classmethod
    def from_toml(cls, path: str | Path, measure: Measure | None = None) -> Study:
        """The study of a file. Its scenario is a path beside it, or the name of an example of Carom."""
        path = Path(path)
        with named_in(path):
            return cls.of(**arguments(path, tables(path, KEYS)), measure=measure)

    def check(self) -> None:
        """Refuse what cannot be computed, before anything is: names, expressions, the scene of the first case."""
        for name in self.points:
            if name in RESERVED:
                raise CaromError(
                    f"parameters.{name}: a column of the results is called so; choose another name"
                )
        tables = self.design.table or {}
        texts = {axis.name: axis.quantity for axis in self.axes}
        self.targeting.check_units(texts | {name: with_unit(values) for name, values in tables.items()})
        self.targeting.check()
        if self.bodies is not None:
            names = self.targeting.base.names
            for name in self.bodies:
                if name not in names:
                    raise CaromError(f"keep.bodies: no ball is called {name!r}; {among(name, names)}")

    @cached_property
    def points(self) -> dict[str, F64]:
        """Values of the parameters, (cases,) each."""
        return self.design.points(self.axes)

    @property
    def columns(self) -> dict[str, F64]:
        """The points under the names of their columns: a start value is not to be mistaken for the final one."""
        return {column(name): values for name, values in self.points.items()}

    @property
    def ends(self) -> list[str]:
        """The columns of the final state, of the balls that are kept."""
        names = self.targeting.base.names
        kept = self.bodies if self.bodies is not None else names if len(names) <= LISTED_BODIES else ()
        return [
            f"{ball}.{quantity}.{x}"
            for ball in kept
            for quantity, (letters, _) in QUANTITIES.items()
            for x in letters
        ]

    def check_columns(self, wanted: Sequence[str]) -> None:
        """Refuse columns that no table of the study will have; those of a measure are not known before it is called."""
        known = [*self.columns, *RESERVED, *self.ends]
        for name in wanted if self.measure is None else ():
            if name not in known:
                raise CaromError(f"the study has no column {name!r}; {did_you_mean(name, known)}")

    @cached_property
    def targeting(self) -> Targets:
        """Where the values go."""
        return Targets.of(self.text, self.source, self.folder, self.case, self.run, self.targets, self.points)

    @property
    def cases(self) -> int:
        """How many there are."""
        return len(next(iter(self.points.values())))

    @cached_property
    def identity(self) -> str:
        """A hash of all that determines a row beside the values of its case; comments in files do not count."""
        content = {
            "format": FORMAT,
            "scenario": tomllib.loads(self.text),
            "case": self.case,
            "set": self.targeting.expressions,
            "run": self.run,
            "runs": self.keep_runs,
            "bodies": self.bodies,
            "measure": identity_of(self.measure),
        }
        if surfaces := self.targeting.surfaces:
            content["meshes"] = [
                hashlib.sha256(made.vertices.tobytes() + made.corners.tobytes()).hexdigest()
                for made in surfaces.values()
            ]
        return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()

    @cached_property
    def ids(self) -> list[str]:
        """A name for each case, a hash of its content: the same in every study that holds the case."""
        names = sorted(self.points)
        rows = zip(*(self.points[name].tolist() for name in names), strict=True)
        return [
            hashlib.sha256(f"{self.identity}{dict(zip(names, row, strict=True))!r}".encode()).hexdigest()[:16]
            for row in rows
        ]

    def __repr__(self) -> str:
        return f"<Study {self.title!r}: {self.cases} cases of {', '.join(self.points)}, design {self.design.kind}>"


def column(name: str) -> str:
    """What the column of a parameter is called."""
    return f"{name}.start" if set(name.split(".")) & set(KINEMATICS) else name


def tables(path: Path, keys: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    """The tables of a study file, with the `keys` that each section may have."""
    text = _read(path)
    try:
        raw = tomllib.loads(text)
    except ValueError as error:
        raise CaromError(f"{path} is not TOML: {error}") from error
    _known(path, "", raw, keys)
    for section in ("design", "keep", "parameters", "search", "set", "run"):
        if not isinstance(raw.get(section, {}), dict):
            raise CaromError(f"{path}: expected a table, write [{section}] and its keys below")
        _known(path, section, raw.get(section, {}), keys)
    if raw.get("format") != FORMAT:
        found = f"format = {raw['format']!r}" if "format" in raw else "format is missing"
        raise CaromError(f"{path}: {found}; write format = {FORMAT} at the top")
    if not isinstance(raw.get("scenario"), str):
        raise CaromError(f'{path}: scenario is missing; write scenario = "FILE.toml"')
    if not isinstance(raw.get("keep", {}).get("runs", False), bool):
        raise CaromError(f"{path}: keep.runs: expected true or false, found {raw['keep']['runs']!r}")
    return raw


def arguments(path: Path, raw: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of `Study.of` in the tables of a file. Its scenario is a path beside it, or an example of Carom."""
    design, keep = dict(raw.get("design", {})), raw.get("keep", {})
    file = design.pop("file", None)
    kind = design.pop("kind", "grid" if file is None else "table")
    for key in ("count", "seed"):
        if key in design and (
            isinstance(design[key], bool) or not isinstance(design[key], int) or design[key] < 0
        ):
            raise CaromError(f"{path}: design.{key}: expected a whole number, found {design[key]!r}")
    if (file is not None) != (kind == "table"):
        raise CaromError(f"{path}: design.kind = table and design.file = FILE.csv belong together")
    found = {
        "scene": _scenario(path, raw["scenario"]),
        "parameters": raw.get("parameters"),
        "design": kind,
        **design,
        "table": None if file is None else path.parent / str(file),
        "set": raw.get("set"),
        "case": raw.get("case"),
        "title": str(raw.get("title", path.stem.encode(errors="replace").decode())),
        "keep_runs": keep.get("runs", False),
        "bodies": keep.get("bodies"),
    }
    run = raw.get("run", {})
    for key in run:
        if key in (*found, "count", "seed", "measure", "check"):
            raise CaromError(
                f"{path}: unknown key run.{key}; {did_you_mean(key, [*SINGLE['run'].model_fields])}"
            )
    return {**found, **run}


@contextmanager
def named_in(path: Path) -> Iterator[None]:
    """Errors of what a file says name the file, and the line of the key that they begin with."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(
            replace(p, where=str(path), line=_line(path, key := f"run.{p.key}"), key=key)
            if p.where == RUN
            else p
            for p in error.problems
        ) from None
    except CaromError as error:
        if type(error) is not CaromError or str(path) in str(error):
            raise
        line = _line(path, str(error))
        raise CaromError(f"{path}{f':{line}' if line else ''}: {error}") from error


def _line(path: Path, told: str) -> int | None:
    """The line of the key, as `parameters.speed`, that a text begins with. Its name may have points."""
    section, *parts = re.split(r"[\s:=]", told, maxsplit=1)[0].split(".")
    lines = LineMap(_read(path)).paths()
    keys = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
    return next((lines[section, key] for key in keys if (section, key) in lines), None)


def _known(path: Path, section: str, table: Mapping[str, Any], keys: Mapping[str, tuple[str, ...]]) -> None:
    for key in table if section in keys else ():
        if key not in keys[section]:
            place = f"{section}.{key}" if section else key
            raise CaromError(f"{path}: unknown key {place}; {did_you_mean(key, keys[section])}")


def _read(path: Path) -> str:
    return read_text(path)


def _example_or(path: Path) -> Path:
    """The example that is called like a path where nothing is, else the path."""
    called = path.as_posix()
    is_example = not path.exists() and path.suffix != ".toml" and len(named(called)) == 1
    return find(called) if is_example else path


def _scenario(study: Path, named: str) -> Path:
    """The scenario of a study: beside it, or an example that comes with Carom."""
    beside = study.parent / named
    if beside.exists() or named.endswith(".toml"):
        return beside
    return Path(find(named))


def identity_of(measure: Measure | None) -> str | None:
    """What distinguishes a measure from others: the `identity` that it states, or its source."""
    if measure is None:
        return None
    if (stated := getattr(measure, "identity", None)) is not None:
        return str(stated)
    try:
        return inspect.getsource(measure)
    except (OSError, TypeError):
        return getattr(measure, "__qualname__", repr(type(measure)))
