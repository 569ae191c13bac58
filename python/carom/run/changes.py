"""What may change when a run is continued: how its contact problems are solved, and nothing that they are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from carom.errors import CaromError, nearest
from carom.result.directory import RunDir
from carom.run import summary
from carom.scene.assembly.arrays import identify
from carom.scene.scene import Scene
from carom.scene.tables.model import SINGLE

#: Options that may change when a run is continued: its end; how hard the contact problems are solved, not which ones, as
#: `max_problems` decides; and when checkpoints are written.
CHANGEABLE = (
    "until",
    *("tolerance", "pile_tolerance", "tolerance_floor", "gap_tolerance", "solver", "max_iterations"),
    *("penalty_scale", "proximal_shift", "line_search", "max_line_search", "dense_contacts"),
    *("gauss_seidel_sweeps", "max_halvings", "on_nonconvergence", "threads"),
    *("checkpoint_steps", "checkpoint_time", "checkpoint_wall"),
)


def refuse_other_physics(options: Mapping[str, Any], places: Mapping[str, str]) -> None:
    """Raise unless all `options` may change within a run."""
    for key in options:
        if key not in CHANGEABLE:
            known = any(key in SINGLE[name].model_fields for name in ("run", "record"))
            meant = None if known else nearest(key, CHANGEABLE)
            cure = f"did you mean {meant}?" if meant else "start a new run for it"
            place = places.get(key, key)
            where = place if place.startswith("-") or place == key else f"{place}: {key}"
            raise CaromError(f"{where}: cannot change within a run, only {', '.join(CHANGEABLE)} can; {cure}")


def restore_functions(
    directory: RunDir, scene: Scene, functions: Callable[..., Any] | Sequence[Callable[..., Any]] = ()
) -> None:
    """Give the scene of a run its Python functions again, in the order of `scene.load_functions`; raise if they do not fit.

    Only their names are in the scenario of the run: that each is the same function as before is up to the caller.
    """
    given = [functions] if callable(functions) else list(functions)
    missing = [place.name for place in scene.load_functions if place.function is None]
    if len(given) != len(missing):
        names = ", ".join(missing) or "none"
        call = f'carom.resume("{directory.path}", load_functions=[{", ".join(missing)}])'
        cure = f"continue it in Python, as {call}" if missing else "leave load_functions out"
        raise CaromError(
            f"{directory.path}: the run has the Python load functions: {names}; {len(given)} given; {cure}"
        )
    for name, function in zip(missing, given, strict=True):
        scene.load_function(function, name=name)


def refuse_to_fail_again(directory: RunDir, about: Mapping[str, Any]) -> None:
    """Raise if the run failed in a step that this Carom would fail to solve again."""
    outcome = about.get("outcome") or {}
    same_core = about["versions"]["core"] == summary.versions()["core"]
    if about["status"] == "failed" and outcome.get("kind") != "error" and same_core:
        raise CaromError(
            f"the run failed at step {outcome.get('step')} and would fail there again; change how it is solved, as"
            f" `carom resume {directory.path} --set tolerance=1e-7`, or start a new run with a smaller step"
        )


def identities(about: Mapping[str, Any]) -> list[str]:
    """The scenario as it was run, before and after each change of a numerical option."""
    return [about["scenario"]["identity"], *about["scenario"].get("earlier", [])]


def note_changes(
    directory: RunDir, about: dict[str, Any], old: Mapping[str, Any], new: Mapping[str, Any], step: int
) -> None:
    """Record in the content of `run.json` and in the log that the run goes on after `step` with other options.

    `old` and `new` are the models of the core, of `scenario.toml` as it lies there and as it will be. What was noted of
    steps that are now computed again is put right: they get the options of `new`.
    """
    before, after = old["options"], new["options"]
    changed = {key: [before[key], after[key]] for key in after if before[key] != after[key]}
    identity = identify(new)
    noted = about.pop("changes", [])
    if identify(old) != about["scenario"]["identity"]:
        # The last one was announced by a process that was killed before it had written the scenario: it never came true.
        noted = noted[:-1]
    about["scenario"]["earlier"] = [k for k in identities(about) if k != identity]
    about["scenario"]["identity"] = identity
    if changed:
        noted.append({"after_step": step, "options": changed})
        directory.log("options changed", after_step=step, options=changed)
    if noted and step > 0:  # from the start on it is one run with one set of options
        about["changes"] = [{**change, "after_step": min(change["after_step"], step)} for change in noted]
