"""`carom schema`."""

from __future__ import annotations

from carom.cli.options import Json
from carom.cli.output import emit, guarded


@guarded
def schema(as_json: Json = False) -> None:
    """Print the JSON Schema of scenario files, for editors.

    Editors use it to complete and to check what you type.

    Example: carom schema > carom-scenario.schema.json
    """
    from carom.scene.toml.schema import json_schema

    emit(json_schema())
