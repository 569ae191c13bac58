"""`run.json` as others may have left it: read, and held against what a run writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from carom.errors import CaromError, quoted
from carom.rundir import RunDir

#: What `run.json` holds at least, of what this module reads, and of which kind.
CONTENT: Mapping[str, tuple[type, ...]] = {
    "status": (str,),
    "outcome": (dict, type(None)),
    "scenario": (dict,),
    "summary": (dict,),
    "versions": (dict,),
}


def checked(directory: RunDir) -> dict[str, Any]:
    """The content of `run.json`, if it is what a run writes."""
    about = directory.read()
    for key, kinds in CONTENT.items():
        if key in about and not isinstance(about[key], kinds):
            raise CaromError(_altered(directory, key, about[key]))
    if "status" not in about:
        raise CaromError(f"{directory.about} does not say how the run stands (no status); it is damaged")
    parts = about.get("scenario", {})
    values = parts.get("parameters", {})
    if not isinstance(values, dict) or any(isinstance(v, str | bool | list | dict) for v in values.values()):
        raise CaromError(_altered(directory, "scenario.parameters", values))
    outcome = about.get("outcome") or {}
    known = {"step": (int,), "time": (int, float), "residual": (int, float), "bodies": (list, tuple)}
    for name, kinds in known.items():
        if outcome.get(name) is not None and not isinstance(outcome[name], kinds):
            raise CaromError(_altered(directory, f"outcome.{name}", outcome[name]))
    if outcome and "kind" not in outcome:
        raise CaromError(_altered(directory, "outcome", outcome))
    return about


def _altered(directory: RunDir, key: str, found: object) -> str:
    return f"{directory.about}: {key}: found {quoted(found)}, which no run writes; the file was altered or damaged"
