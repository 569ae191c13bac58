"""The base of every table of the format: unknown keys are refused, and so are wrong values assigned later."""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, ValidationError

from carom.errors import Problem, ScenarioError, did_you_mean, quoted
from carom.scene.messages import from_python


class Table(BaseModel):
    """A TOML table. Values are checked when it is made and when an attribute is set; errors are `ScenarioError`."""

    model_config = ConfigDict(extra="forbid", validate_assignment=True, protected_namespaces=())

    section: ClassVar[str] = ""
    """Name of the table in the file."""

    def __setattr__(self, name: str, value: Any) -> None:
        known = type(self).model_fields
        if name not in known and not name.startswith("_"):
            raise ScenarioError([Problem(self.label(), name, "unknown key", did_you_mean(name, list(known)))])
        try:
            super().__setattr__(name, value)
        except ValidationError as e:
            raise from_python(e, type(self), self.label(), {**self.__dict__, name: value}) from None

    def label(self) -> str:
        """How messages call this table."""
        name = getattr(self, "name", None)
        return f"scene.{self.section}" + (f"[{quoted(name)}]" if name else "")

    def written(self, *, everything: bool = False) -> dict[str, Any]:
        """The keys as they stand in a file: those that were given, or every one that has a value."""
        return self.model_dump(exclude_unset=not everything, exclude_none=True)
