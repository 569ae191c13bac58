"""Contact laws that method `penalty` cannot honour, as the core refuses them (`crates/carom-penalty/src/lib.rs`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from carom.scene.messages import Finding
from carom.scene.tables.model import Contact

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts


def check_penalty(parts: Parts) -> Iterator[Finding]:
    """Regularised friction turns no slip round, and a tangential spring leaves none over."""
    options = {} if parts.run is None else parts.run.options()
    if options.get("method") != "penalty":
        return
    spring = options["penalty_friction"] == "spring"
    for i, law in parts.tables(Contact):
        e, place = law.tangential_restitution, ("contact", i, "tangential_restitution")
        if spring and e < 0:
            cause = f"is {e:g}, and the friction spring of method penalty leaves no slip over"
            yield Finding(place, cause, "set 0 or more")
        elif not spring and e != 0:
            cause = f"is {e:g}, and regularised friction of method penalty has none"
            yield Finding(place, cause, 'set 0, or penalty_friction = "spring"')
