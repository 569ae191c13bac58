"""Which contact problems of a run are kept, and the sink that writes them (`carom.problem.run_files`)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from carom.errors import CaromError
from carom.files import inside
from carom.problem.errors import ContactProblemError
from carom.problem.kept import FORMS
from carom.problem.run_files import FOLDER, file_name, kept_files, write_kept
from carom.run.loop import Sink

if TYPE_CHECKING:
    from carom._core import Simulation
    from carom.result.data import RunData
    from carom.result.directory import RunDir

#: How the problems to keep are chosen.
CHOICE = 'steps as "100,200:300:50" (first:last:stride), "all", or "worst:10" for the 10 with most iterations'

Given = str | int | Iterable[int]
"""What `save_problems` takes: see `CHOICE`; also a step, or several."""

_LAST = 2**64 - 1


@dataclass(frozen=True)
class Choice:
    """Which problems of a run are kept, and in which form: `(first, last, stride)` of steps, and so many of the hardest."""

    text: str
    steps: tuple[tuple[int, int, int], ...]
    hardest: int
    form: str = "local"

    @classmethod
    def of(cls, given: Given, form: str = "local", label: str = "save_problems") -> Choice:
        """From what `carom.simulate(save_problems=...)` or the command line was given; `label` is what messages say."""
        if form not in FORMS:
            raise CaromError(f"the form of problems is {form!r}; it must be {' or '.join(FORMS)}")
        text = given if isinstance(given, str) else ",".join(map(str, _listed(given, label)))
        steps: list[tuple[int, int, int]] = []
        hardest = 0
        for word in filter(None, (word.strip() for word in text.split(","))):
            if word == "all":
                steps.append((1, _LAST, 1))
            elif (found := re.fullmatch(r"worst:(\d+)", word)) and int(found[1]) > 0:
                hardest = int(found[1])
            elif found := re.fullmatch(r"(\d+)(?::(\d+)(?::(\d+))?)?", word):
                first = int(found[1])
                last, stride = int(found[2] or first), int(found[3] or 1)
                if not 1 <= first <= last <= _LAST or not 1 <= stride <= _LAST:
                    raise CaromError(f"{label}: no step is in {word!r}; steps count from 1; give {CHOICE}")
                steps.append((first, last, stride))
            else:
                raise CaromError(f"{label}: {word!r} cannot be read; give {CHOICE}")
        if not steps and not hardest:
            raise CaromError(f"{label}: nothing is chosen; give {CHOICE}")
        return cls(text, tuple(steps), hardest, form)

    def has(self, step: int) -> bool:
        """Whether everything of a step is kept, however hard it is."""
        return any(
            first <= step <= last and (step - first) % stride == 0 for first, last, stride in self.steps
        )


def unmet(choice: Choice, result: RunData, label: str = "save_problems") -> str | None:
    """What a finished run says of a choice that it could not meet: steps beyond it, or none with contacts."""
    made = len(result.steps)
    ends = [
        first + (last - first) // stride * stride for first, last, stride in choice.steps if last != _LAST
    ]
    late = [str(end) for end in ends if end > made]
    if late:
        return f"{label}: the run ended at step {made}, before {', '.join(late)}; choose steps up to {made}"
    if not kept_files(result.path):
        return f"{label}: none of the steps that were chosen had contacts; choose steps where `steps` counts some"
    return None


def _listed(given: int | Iterable[int], label: str) -> list[int]:
    steps = list(given) if isinstance(given, Iterable) else [given]
    if any(isinstance(step, bool) or not hasattr(step, "__index__") for step in steps):
        raise CaromError(f"{label}: steps are whole numbers; give {CHOICE}")
    return steps


class Problems(Sink):
    """Asks a simulation for the problems of a choice and writes them to the directory of its run."""

    def __init__(self, directory: RunDir, choice: Choice) -> None:
        self.directory, self.choice = directory, choice
        self._step, self._seen = 0, Counter[str]()

    def start(self, simulation: Simulation) -> None:
        """Tell the simulation, before its first step."""
        simulation.keep_problems(list(self.choice.steps), self.choice.hardest)

    def take(self, simulation: Simulation, block: object) -> None:
        """Write what was kept since the last call."""
        self._write(simulation.take_problems(False))

    def end(self, simulation: Simulation) -> None:
        """Write the hardest problems too, but for those of chosen steps, of which everything is there.

        The core gives the hardest by iterations and does not say in which order a step posed them. So of several that are
        called the same the hardest one is the first.
        """
        self._write(simulation.take_problems(False))
        self._seen.clear()
        hardest = [kept for kept in simulation.take_problems(True) if not self.choice.has(kept["step"])]
        self._write(sorted(hardest, key=lambda kept: kept["step"]))  # stable: within a step the hardest first

    def _write(self, kept: Iterable[Mapping[str, Any]]) -> None:
        """Write problems in the order of their steps; what is called as one before it in its step has a number `again`."""
        for problem in kept:
            if problem["step"] != self._step:
                self._step = problem["step"]
                self._seen.clear()
            name = file_name(problem)
            problem = {**problem, "again": self._seen[name]}
            self._seen[name] += 1
            path = inside(self.directory.path, FOLDER) / file_name(problem)
            try:
                write_kept(path, problem, self.choice.form)
            except ContactProblemError as error:  # a run does not stop because a problem has no form as data
                self.directory.log("problem not kept", file=path.name, message=str(error))
