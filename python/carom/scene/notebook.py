"""What notebooks show of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carom.text import LISTED, page, vector

if TYPE_CHECKING:
    from carom.scene.scene import Scene


def of_scene(scene: Scene) -> str:
    """What `repr` says, and the contact laws."""
    run, names = scene.run, scene.names
    facts = [
        (
            "balls",
            (f"{len(names)}: " if names else "none")
            + ", ".join(names[:LISTED])
            + (" ..." if len(names) > LISTED else ""),
        ),
        *([("clumps", ", ".join(clump.name for clump in scene.clumps[:LISTED]))] if scene.clumps else []),
        ("walls", ", ".join(scene.wall_names[:LISTED]) or "none"),
        ("gravity", f"{vector(scene.gravity)} m/s^2"),
        (
            "run",
            f"method {run.method}, step {run.step:g} s, until {'not given' if run.until is None else f'{run.until:g} s'}",
        ),
    ]
    head = ["contact law", "friction", "restitution", "rolling radius (m)"]
    rows = [
        [
            " / ".join(law.between),
            _law(law.friction, "slip"),
            _law(law.restitution, "approach"),
            f"{law.rolling_radius:g}",
        ]
        for law in scene._tree.contact
    ]
    return page(scene.title or "carom.Scene", facts, head, rows)


def _law(value: object, speed: str) -> str:
    return f"{value:g}" if isinstance(value, float | int) else f"law of the {speed} speed"
