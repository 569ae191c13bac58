"""`run.json` as others may have left it: read, and held against what a run writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from carom.errors import CaromError, quoted
from carom.result.directory import RunDir
from carom.result.record import Segments

#: What `run.json` holds at least, of what this module reads, and of which kind.
CONTENT: Mapping[str, tuple[type, ...]] = {
    "status": (str,),
    "outcome": (dict, type(None)),
    "scenario": (dict,),
    "summary": (dict,),
    "versions": (dict,),
    "segments": (list,),
    "changes": (list,),
}

#: What is needed besides where a run is continued; a name with dots is within another.
CONTINUED: Mapping[str, tuple[type, ...]] = {
    "scenario.identity": (str,),
    "scenario.title": (str, type(None)),
    "scenario.file": (str, type(None)),
    "versions.core": (str,),
    "segments": (list,),
}

#: The same for what not every run has.
CONTINUED_IF_THERE: Mapping[str, tuple[type, ...]] = {
    "scenario.earlier": (list,),
    "changes": (list,),
    "save_problems": (dict,),
}

#: Of each entry of a list, and of the wish to keep problems.
ENTRIES: Mapping[str, Mapping[str, tuple[type, ...]]] = {
    "segments": {"from_step": (int,), "wall_s": (int, float), "core_s": (int, float)},
    "changes": {"after_step": (int,), "options": (dict,)},
    "save_problems": {"choice": (str,), "form": (str,)},
}

#: What a part of a run has once it is known.
PART: Mapping[str, type] = {"file": str, "files": list, "from_step": int, "to_step": int}


def checked(directory: RunDir) -> dict[str, Any]:
    """The content of `run.json`, if it is what a run writes."""
    about = directory.read()
    for key, kinds in CONTENT.items():
        if key in about and not isinstance(about[key], kinds):
            raise CaromError(_altered(directory, key, about[key]))
    if "status" not in about:
        raise CaromError(f"{directory.about} does not say how the run stands (no status); it is damaged")
    parts = about.get("scenario", {})
    for name in ("parameters", "study"):
        values = parts.get(name, {})
        if not isinstance(values, dict) or any(
            isinstance(v, str | bool | list | dict) for v in values.values()
        ):
            raise CaromError(_altered(directory, f"scenario.{name}", values))
    outcome = about.get("outcome") or {}
    known = {"step": (int,), "time": (int, float), "residual": (int, float), "bodies": (list, tuple)}
    for name, kinds in known.items():
        if outcome.get(name) is not None and not isinstance(outcome[name], kinds):
            raise CaromError(_altered(directory, f"outcome.{name}", outcome[name]))
    for name in ("segments", "changes"):
        if any(not isinstance(one, dict) for one in about.get(name) or ()):
            raise CaromError(_altered(directory, name, about[name]))
    for part in about.get("segments") or ():
        if any(key in part and not isinstance(part[key], kind) for key, kind in PART.items()):
            raise CaromError(_altered(directory, "segments", part))
    if outcome and "kind" not in outcome:
        raise CaromError(_altered(directory, "outcome", outcome))
    return about


def continued(directory: RunDir) -> dict[str, Any]:
    """The content of `run.json`, if a run can be continued by it."""
    about = checked(directory)

    def within(key: str) -> Any:
        found: Any = about
        for part in key.split("."):
            found = found.get(part) if isinstance(found, dict) else None
        return found

    for key, kinds in {**CONTINUED, **CONTINUED_IF_THERE}.items():
        found = within(key)
        if not isinstance(found, kinds) and (key in CONTINUED or found is not None):
            raise CaromError(_altered(directory, key, found))
    for key, entry in ENTRIES.items():
        found = within(key)
        for one in found if isinstance(found, list) else [] if found is None else [found]:
            if not isinstance(one, dict) or any(
                not isinstance(one.get(k), kinds) for k, kinds in entry.items()
            ):
                raise CaromError(_altered(directory, key, one))
    return about


def opened(directory: RunDir, about: Mapping[str, Any]) -> Segments:
    """The results. Raises if some are not there that came before others, or before the step at which the run ended."""
    paths = directory.segments()
    if not paths and directory.is_being_written():
        raise CaromError(f"{directory.path}: there are no results yet: the run has just begun")
    cure = f"`carom resume {directory.path} --checkpoint start` computes the run anew"
    if not paths:
        raise CaromError(f"{directory.path}: results.h5 is missing; {cure}")
    segments = Segments(paths)
    parts, starts = about.get("segments") or [{}], segments.starts
    # One that is being written may be longer by now.
    ended = None if directory.is_being_written() else parts[-1].get("to_step")
    lack = segments.lack(ended)
    if lack is None:
        return segments
    wrong = []
    for part in parts:
        first = part.get("file")
        files = part.get("files", [first] if first else [])
        wrong += [f"{name} is missing" for name in files if name not in starts]
        if starts.get(first, part.get("from_step")) != part.get("from_step"):
            wrong.append(f"{first} begins after step {starts[first]} and not {part.get('from_step')}")
    raise CaromError(f"{directory.path}: {'; '.join([*wrong, lack, cure])}")


def _altered(directory: RunDir, key: str, found: object) -> str:
    return f"{directory.about}: {key}: found {quoted(found)}, which no run writes; the file was altered or damaged"
