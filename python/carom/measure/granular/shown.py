"""How measures print themselves: their numbers by name, long arrays by their shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, TypeVar, cast

import numpy as np

from carom.errors import CaromError

T = TypeVar("T")

MOST = 4
"""Numbers of an array that are printed; of a longer one its shape is."""


class NotKnown(CaromError):
    """Something was left out of a `Snapshot`."""


def part(of: Callable[[], T]) -> T:
    """A field of a `Measure`; where what it needs is not known the reason, which is told when the field is asked for."""
    try:
        return of()
    except NotKnown as why:
        return cast(T, why)


class Measure:
    """A result of this package; its attributes are its fields and properties."""

    def __getattribute__(self, name: str) -> Any:
        found = object.__getattribute__(self, name)
        if isinstance(found, NotKnown):
            raise found.with_traceback(None)
        return found

    def _shown(self, name: str) -> Any:
        try:
            return getattr(self, name)
        except NotKnown:
            return "not known"

    def __repr__(self) -> str:
        kind = type(self)
        properties = (name for name, it in vars(kind).items() if isinstance(it, property))
        names = [*(field.name for field in fields(self)), *properties]  # type: ignore[arg-type]  # all are dataclasses
        shown = [(name, self._shown(name)) for name in names if not name.startswith("_")]
        shown.sort(key=lambda pair: _long(pair[1]))  # stable: numbers first, each group in its order
        return f"{kind.__name__}({', '.join(f'{name}={_words(value)}' for name, value in shown)})"


def _long(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size > MOST


def _words(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_words, value))})"
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if _long(value):
        return f"<{' x '.join(map(str, value.shape))}>"
    return (
        np.array2string(value, precision=6, separator=", ") if isinstance(value, np.ndarray) else str(value)
    )
