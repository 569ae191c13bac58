"""What Carom says when a description is wrong.

Every mistake a person can make in a scenario (a file or a `carom.Scene`) becomes a `Problem`: where it is,
what was found, what would be right. A `ScenarioError` holds all problems of a scenario, so that they are
mended in one go. Nothing here imports more than the standard library: the command line catches these errors
before it loads anything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from importlib import import_module  # noqa: TID251 the packages of extras
from itertools import islice
from typing import Any, TypeVar

SHOWN = 50
"""Problems printed by `str(error)`; a generated file can have one per sphere. `error.problems` holds all of them."""


class CaromError(ValueError):
    """Root of every error that Carom raises on purpose: the user can mend the cause."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Errors go between processes; what the `__init__` of a derived one takes is no concern of a copy."""
        return _again, (type(self), self.args), self.__dict__


def _again(kind: type[CaromError], arguments: tuple[Any, ...]) -> CaromError:
    return kind.__new__(kind, *arguments)


class CaromWarning(UserWarning):
    """Advice on a scene that can be simulated but may not mean what its author thinks."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong (or, in a list of warnings, one piece of advice).

    `where` is a file, or the call such as `Scene.sphere("cue")`; `line` (from 1) and `source` (that line) are
    given for files only. `cause` says what was found and what is allowed, `cure` what to write instead; both
    fit on one line.
    """

    where: str
    key: str
    cause: str
    cure: str
    line: int | None = None
    source: str = ""

    def __str__(self) -> str:
        place = self.where if self.line is None else f"{self.where}:{self.line}"
        key = f" {self.key}:" if self.key else ""
        return one_line(f"{place}:{key} {self.cause}; {self.cure}")

    def to_dict(self) -> dict[str, Any]:
        """The fields, for `--json`."""
        return asdict(self)


class ScenarioError(CaromError):
    """A scenario that cannot be simulated as it stands; `problems` holds everything that is wrong with it.

    `str(error)` is a list of lines `FILE:LINE: key: cause; cure`; `error.report()` shows the lines of the
    file as well.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems: list[Problem] = sorted(problems, key=lambda p: (p.where, p.line or 0))
        super().__init__(str(self))

    def __str__(self) -> str:
        return "\n".join([*map(str, self.problems[:SHOWN]), *self._rest()])

    def report(self) -> str:
        """The same list with the line of the file under each problem, for a terminal."""
        shown = []
        for problem in self.problems[:SHOWN]:
            shown.append(str(problem))
            if problem.source.strip():
                shown.append(f"    {problem.line} | {one_line(problem.source.strip(), 120)}")
        return "\n".join([*shown, *self._rest()])

    def _rest(self) -> list[str]:
        more = len(self.problems) - SHOWN
        return [f"... and {more} more problems of this kind or other"] if more > 0 else []


def one_line(text: str, width: int = 600) -> str:
    """`text` without line breaks or control characters (a file could otherwise write on the terminal), cut at `width`."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= width else clean[: width - 3] + "..."


def quoted(value: object) -> str:
    """A value as the scenario's author would write it, short enough for a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + one_line(value, 40).replace('"', "'") + '"'
    if isinstance(value, dict):
        return "a table"
    if value is None:
        return "nothing"
    if isinstance(value, int) and value.bit_length() > 128:  # Python refuses to print very long ones
        return f"a whole number of about {round(value.bit_length() * 0.30103)} digits"
    if isinstance(value, list):
        return one_line(f"[{', '.join(map(quoted, value[:10]))}]", 40)
    if hasattr(value, "isoformat"):
        return f"the {'date' if hasattr(value, 'year') else 'time'} {value.isoformat()}"
    return one_line(repr(value), 40)


def counted(n: int, what: str) -> str:
    """`1 step`, `2 steps`."""
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


V = TypeVar("V")


def only_once(given: Iterable[tuple[str, str, V]]) -> dict[str, V]:
    """Values by their place, of places, what messages call who set them, and values; refuses a place that is set twice."""
    found: dict[str, V] = {}
    setters: dict[str, str] = {}
    for place, setter, value in given:
        if place in found:
            first = setters[place]
            told = "is given twice" if first == setter else f"{first} sets {place}, too"
            raise CaromError(f"{setter}: {told}; leave out one of the two")
        found[place], setters[place] = value, setter
    return found


SYNONYMS: dict[str, tuple[str, ...]] = {
    "step": ("dt", "h", "timestep", "time_step", "step_size"),
    "until": ("t_end", "tend", "t_max", "tmax", "t", "duration", "end", "end_time"),
    "tolerance": ("tol", "tol_r", "rtol"),
    "closing_tolerance_load": ("pile_closing_tolerance",),
    "friction": ("mu", "friction_coefficient"),
    "restitution": ("e", "e_n", "en", "cor"),
    "tangential_restitution": ("e_t", "et"),
    "rolling_radius": ("rho", "rolling_friction", "rolling_resistance"),
    "spinning_radius": ("delta", "spinning_friction"),
    "cohesion": ("adhesion", "pull_off_force", "attraction"),
    "rupture_distance": ("cohesion_range", "rupture"),
    "spectral_radius": ("rho_inf",),
    "radius": ("r",),
    "mass": ("m",),
    "density": ("rho",),
    "position": ("pos", "x", "center", "centre"),
    "velocity": ("v", "vel"),
    "angular_velocity": ("omega", "w", "spin"),
    "gravity": ("g",),
    "out": ("save", "output", "directory", "save_to"),
    "normal": ("n",),
    "sphere": ("ball", "balls", "particle", "particles", "grain", "grains"),
    "plane": ("wall", "walls", "floor", "ground"),
}
"""What other programs, the literature and earlier versions call the keys."""


def extra(module: str, needs: str, name: str, cure: str = "") -> Any:
    """A module that comes with an extra; where it is missing the error tells what `needs` it and how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise CaromError(f"{needs}: pip install 'carom[{name}]'{cure}") from error


def nearest(name: str, known: Sequence[str]) -> str | None:
    """The known name that the user probably meant, or None."""
    if name.lower() in known:
        return name.lower()
    for key, others in SYNONYMS.items():
        if key in known and name.lower() in others:
            return key
    # At 0.6, the default, save is near solver.
    found = get_close_matches(name.lower()[:80], known, n=1, cutoff=0.65)
    return found[0] if found else None


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """A cure: the nearest known name, or the list of all of them."""
    best = nearest(name, known)
    if best and len(known) > 12:
        return f"did you mean {_in_a_list(best)}?"
    listed = ", ".join(map(_in_a_list, known)) if known else "(none)"
    return f"did you mean {_in_a_list(best)}? (known: {listed})" if best else f"known: {listed}"


def _in_a_list(name: str) -> str:
    """A name in quotes where it could be taken for several."""
    return quoted(name) if "," in name else name


#: Names that are searched and shown where there are very many.
MANY = 20


def among(name: str, *known: Sequence[str]) -> str:
    """As `did_you_mean` of many names, as those of balls: of each list the first ones, and those that begin alike."""
    chosen = [list(names[:MANY]) for names in known]
    for mine, names in zip(chosen, known, strict=True):
        alike = (n for n in names[MANY:] if n.startswith(name) or name.startswith(n))
        mine += islice(alike, MANY if name else 0)
    return did_you_mean(name, [n for mine in chosen for n in mine])
