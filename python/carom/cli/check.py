"""`carom check`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carom.cli.options import Case, Json, Scenario, Set, scene
from carom.cli.output import BAD_INPUT, DONE, emit, fail, guarded

if TYPE_CHECKING:
    from carom.errors import Problem
    from carom.scene import Scene


@guarded
def check(scenario: Scenario, case: Case = None, set_: Set = None, as_json: Json = False) -> int:
    """Check a scenario without running it: all errors at once, and advice on what may go wrong.

    Of a file with cases the file as it stands and every case are checked; with --case that one alone.
    Judging a finished run by the physics is not part of this version.

    Example: carom check break.toml
    """
    if scenario.is_dir():
        message = f"{scenario} is a directory; this version checks scenario files only, not runs"
        return fail(message, BAD_INPUT, as_json)
    from carom.scenario import load

    described = scene(scenario, case, set_)
    warnings = described.validate()
    cases = load.cases(scenario) if case is None and described.parameters else []
    warnings += _of_cases(scenario, cases, set_, warnings)
    if as_json:
        emit(
            {
                "scenario": str(scenario),
                "ok": True,
                **_facts(described, cases),
                "warnings": [w.to_dict() for w in warnings],
            }
        )
        return DONE
    for advice in warnings:
        print(f"warning: {advice}")
    print(f"{scenario}: ok, {described!r}")
    if described.parameters:
        print("parameters: " + ", ".join(f"{name} = {x:.10g}" for name, x in described.parameters.items()))
    if cases:
        print("cases, all ok: " + ", ".join(cases))
    return DONE


def _facts(described: Scene, cases: list[str]) -> dict[str, Any]:
    facts: dict[str, Any] = {"bodies": len(described.names), "planes": len(described.plane_names)}
    others = len(described.wall_names) - len(described.plane_names)
    if others:
        facts["other_walls"] = others
    if described.parameters:
        facts |= {"case": described.case, "parameters": described.parameters, "cases": cases}
    return facts


def _of_cases(
    scenario: Path, cases: list[str], set_: list[str] | None, known: list[Problem]
) -> list[Problem]:
    """Warnings that some of the cases have besides those that are known; their errors are raised together."""
    from carom.errors import ScenarioError

    found: list[Problem] = []
    wrong: list[Problem] = []
    for case in cases:
        try:
            found += _labelled(case, [p for p in scene(scenario, case, set_).validate() if p not in known])
        except ScenarioError as error:
            wrong += _labelled(case, error.problems)
    if wrong:
        raise ScenarioError(wrong)
    return found


def _labelled(case: str, problems: list[Problem]) -> list[Problem]:
    from carom.errors import quoted

    label = f"case {quoted(case)}"
    return [replace(p, key=f"{label}, {p.key}" if p.key else label) for p in problems]
