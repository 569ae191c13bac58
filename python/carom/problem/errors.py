"""What is said of a contact problem that cannot be used, or only with care."""

from __future__ import annotations

from carom.errors import CaromError, one_line


class ContactProblemError(CaromError):
    """A contact problem that is not one: `place: cause; cure` in one line."""


class ContactProblemWarning(UserWarning):
    """A contact problem that can be used, but is not quite what the theory assumes."""


def refuse(place: str, cause: str, cure: str) -> ContactProblemError:
    """The error for what stands at `place` (a file, or the name of an argument)."""
    return ContactProblemError(one_line(f"{place}: {cause}; {cure}"))
