"""`carom check`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carom.cli.options import Case, Json, Set, option, scene
from carom.cli.output import BAD_INPUT, DONE, emit, fail, guarded
from carom.cli.verdict import is_run, judge
from carom.errors import CaromError, Problem, ScenarioError, quoted

if TYPE_CHECKING:
    from carom.scene.scene import Scene


@guarded
def check(
    what: Annotated[
        Path,
        typer.Argument(
            metavar="SCENARIO|RUN", help="Scenario file (TOML) or run directory.", show_default=False
        ),
    ],
    case: Case = None,
    set_: Set = None,
    rerun: Annotated[
        bool, option("--rerun", "Runs: simulate again, and compare all data bit for bit.")
    ] = False,
    threads: Annotated[
        str | None, option("--threads", "N,M", "Runs: repeat on these numbers of threads (implies --rerun).")
    ] = None,
    as_json: Json = False,
) -> int:
    """Find mistakes in a scenario; judge a run by the laws of physics.

    A scenario: lists all errors at once, and warns of what may go wrong. It checks the file itself and each of its cases;
    --case checks only that case.

    A run: checks that recorded motion, contacts and impacts obey mechanics. No code of the solvers takes part. It shows
    the worst violation of each law, with time and place; the exit code is 3 if there is any.

    Example: carom check break.toml; carom check runs/break-1
    """
    if is_run(what):
        if case is not None or set_:
            return fail(
                "--case and --set are for scenarios; leave them out to check a run", BAD_INPUT, as_json
            )
        return judge(what, rerun=rerun, threads=threads, as_json=as_json)
    if rerun or threads is not None:
        return fail(f"{what} is no run directory; --rerun and --threads are for runs", BAD_INPUT, as_json)
    scenario = what
    from carom.scene.toml import load

    described = scene(scenario, case, set_)
    warnings = _found(described, scenario)
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


def _found(described: Scene, scenario: Path) -> list[Problem]:
    """The warnings; what the scene or the core refuses, as what a method cannot do, is raised."""
    from carom.run.loop import begin

    found = described.validate()
    try:
        begin(described.to_model())
    except CaromError as error:
        cause, _, cure = str(error).partition("; ")
        raise ScenarioError([Problem(str(scenario), "", cause, cure)]) from None
    return found


def _facts(described: Scene, cases: list[str]) -> dict[str, Any]:
    facts: dict[str, Any] = {"bodies": len(described.names), "planes": len(described.plane_names)}
    if described.clumps:
        facts["clumps"] = len(described.clumps)
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
    found: list[Problem] = []
    wrong: list[Problem] = []
    for case in cases:
        try:
            found += _labelled(
                case, [p for p in _found(scene(scenario, case, set_), scenario) if p not in known]
            )
        except ScenarioError as error:
            wrong += _labelled(case, error.problems)
    if wrong:
        raise ScenarioError(wrong)
    return found


def _labelled(case: str, problems: list[Problem]) -> list[Problem]:
    label = f"case {quoted(case)}"
    return [replace(p, key=f"{label}, {p.key}" if p.key else label) for p in problems]
