"""Calls with a wrong keyword: the mistakes that Python would report as a `TypeError` without a cure."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from carom.errors import Problem, ScenarioError, did_you_mean, nearest, quoted

P = ParamSpec("P")
R = TypeVar("R")

ELSEWHERE = {"free": "free walls are planes without end: Scene.plane takes it"}
"""The cure for keywords that only one method knows, in calls of others."""


def wording(name: str, known: list[str]) -> str:
    """The cure for an unknown keyword: `write step=`, or what there is."""
    best = nearest(name, known)
    return f"write {best}=" if best else ELSEWHERE.get(name) or did_you_mean(name, known)


def renamed(function: Callable[P, R]) -> Callable[P, R]:
    """A function whose keyword `set` is called `parameters` now; the old name warns, for one minor version."""

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        if "set" in kwargs:
            told = (
                f"{function.__qualname__}: set= is called parameters= now, and goes in the next minor version"
            )
            warnings.warn(told, DeprecationWarning, stacklevel=2)
            kwargs.setdefault("parameters", kwargs.pop("set"))
        return function(*args, **kwargs)

    return wrapped


def explained(method: Callable[P, R]) -> Callable[P, R]:
    """A method whose keywords, if they do not fit, give a `ScenarioError` that says which ones do.

    Nothing is looked at unless the call fails: scenes of a hundred thousand spheres are made by such calls.
    """

    @functools.wraps(method)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return method(*args, **kwargs)
        except TypeError:
            problems = _misfits(method, args, kwargs)
            if not problems:
                raise
            raise ScenarioError(problems) from None

    return wrapped


def _misfits(method: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> list[Problem]:
    signature = inspect.signature(method)
    try:
        signature.bind(*args, **kwargs)
    except TypeError:
        pass
    else:
        return []  # the call fits: the error came from inside
    named = list(signature.parameters.values())[1:]  # without self
    label = f"Scene.{method.__name__}" if method.__name__ != "__init__" else "Scene"
    if label != "Scene":
        label += f"({', '.join(quoted(a) for a in args[1:3])})"
    known = [p.name for p in named]
    free = [name for name in known if name not in kwargs]
    unknown = [name for name in kwargs if name not in known]
    found = [Problem(label, name, "unknown keyword", wording(name, free)) for name in unknown]
    meant = {nearest(name, free) for name in unknown}
    given = {*kwargs, *known[: len(args) - 1]}
    for p in named:
        if p.default is p.empty and p.name not in given and p.name not in meant:
            found.append(Problem(label, p.name, "is missing", f"add {p.name}=..."))
    positional = [p.name for p in named if p.kind is not p.KEYWORD_ONLY]
    if not found:
        others = [f"{p.name}=" for p in named if p.kind is p.KEYWORD_ONLY]
        only = f"only {', '.join(positional)}" if positional else "nothing"
        cause = f"{only} can be given without a name"
        found.append(Problem(label, "", cause, f"write the others as {', '.join(others[:3])} ..."))
    return found
