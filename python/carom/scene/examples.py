"""`carom.example`: the scenes that come with Carom, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from carom.scene.arguments import renamed
from carom.scene.scene import Scene
from carom.scene.shipped import find


@renamed
def example(name: str, *, case: str | None = None, parameters: Mapping[str, Any] | None = None) -> Scene:
    """The scene of a scenario that comes with Carom, as `carom examples list` names them.

    The last part of a name is enough: `carom.example("5.6_break")` is `carom.example("paper/5.6_break")`. `case`
    and `parameters` choose a variant, as in `Scene.from_toml`.
    """
    return Scene.from_toml(find(name), case=case, parameters=parameters)
