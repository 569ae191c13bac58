"""`carom check`."""

from __future__ import annotations

from carom.cli.options import Json, Scenario
from carom.cli.output import BAD_INPUT, DONE, emit, fail, guarded


@guarded
def check(scenario: Scenario, as_json: Json = False) -> int:
    """Check a scenario without running it: all errors at once, and advice on what may go wrong.

    Judging a finished run by the physics is not part of this version.

    Example: carom check break.toml
    """
    if scenario.is_dir():
        message = f"{scenario} is a directory; this version checks scenario files only, not runs"
        return fail(message, BAD_INPUT, as_json)
    from carom.scene import Scene

    scene = Scene.from_toml(scenario)
    warnings = scene.validate()
    if as_json:
        facts = {"bodies": len(scene.names), "planes": len(scene.plane_names)}
        emit({"scenario": str(scenario), "ok": True, **facts, "warnings": [w.to_dict() for w in warnings]})
        return DONE
    for advice in warnings:
        print(f"warning: {advice}")
    print(f"{scenario}: ok, {scene!r}")
    return DONE
