"""How a batch is computed: threads that take one case after the other and fill arrays."""

from __future__ import annotations

import copy
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError
from carom.many.batch_result import ENDED, KINEMATICS, NOT_RUN, Batch
from carom.many.cases import Overrides
from carom.numeric import is_whole
from carom.run.loop import Sink, begin, drive
from carom.scene.checks.walls import touching
from carom.scene.plan import MOST_BYTES, Plan

if TYPE_CHECKING:
    from carom._core import Block, Simulation
    from carom.run.watch import Watch
    from carom.scene.scene import Scene

COUNTS = (
    *("steps", "unconverged", "fallbacks", "halvings", "substeps"),
    *("missed_impacts", "truncated_sequences"),
)
MONITORS = (*COUNTS, "penetration_max", "penetration_max_relative", "travel_max")
"""What is kept of the core's totals, beside its energies (J) `energy_initial`, `energy_final`, `energy_max_rise`."""

TABLES = ("impacts", "transitions", "events")
"""Tables that are kept, the first two only if they are asked for."""
ENERGIES = ("initial", "final", "max_rise")


def _plan(scene: Scene, every: int | None) -> Plan:
    if scene.run.until is None:
        raise CaromError("simulate_batch: the scene does not say how long to simulate; pass until=...")
    return replace(Plan.of(scene.run.until, scene.run.step, 1, False), every=every or 0)


class _Kept(Sink):
    """The frames of a case on the grid, in its rows of the arrays of the batch, and its small tables."""

    def __init__(self, frames: Mapping[str, Array], plan: Plan) -> None:
        self._frames, self._every = frames, plan.every
        self.tables: dict[str, list[Mapping[str, Any]]] = {name: [] for name in TABLES}

    def start(self, simulation: Simulation) -> None:
        start = simulation.frame() if self._frames else {}
        for key, values in self._frames.items():
            values[0] = start[key]

    def take(self, simulation: Simulation, block: Block) -> None:
        for name, kept in self.tables.items():
            if name in block:
                kept.append(block[name])  # type: ignore[literal-required]
        if self._frames:
            rows, off = np.divmod(block["frames"]["step"].astype(np.int64), self._every)
            for key, values in self._frames.items():
                values[rows[off == 0]] = block["frames"][key][off == 0]


class Runner:
    """Cases, the arrays that they fill, and the threads that do it."""

    def __init__(
        self,
        scenes: Sequence[Scene],
        overrides: Overrides | None,
        frames: int | None,
        impacts: bool,
        watch: Watch | None = None,
    ) -> None:
        if frames is not None and (not is_whole(frames) or frames < 1):
            raise CaromError(f"simulate_batch: frames must be a number of steps from 1 on, found {frames!r}")
        self.scenes, self.overrides, self.every, self.keep_impacts = scenes, overrides, frames, impacts
        self.watch = watch
        self.names = list(scenes[0].names)
        self.bodies = [[*scene.names, *scene.wall_names] for scene in scenes]
        for k, scene in enumerate(scenes):
            if list(scene.names) != self.names:
                raise CaromError(
                    f"simulate_batch: scene {k} has other balls than scene 0; a batch is of the same balls"
                )
        self.plans = [_plan(scene, frames) for scene in scenes]
        self.cases = len(scenes) if overrides is None else overrides.cases
        steps = sorted({plan.step for plan in self.plans})
        if frames is not None and len(steps) > 1:
            raise CaromError(
                f"simulate_batch: frames need one step, the scenes have steps from {steps[0]:g} to {steps[-1]:g} s;"
                " pass step=..., or leave frames out"
            )
        b, n = self.cases, len(self.names)
        self.outcome = np.full(b, NOT_RUN, dtype=object)
        self.message = np.full(b, "", dtype=object)
        self.time = np.full(b, np.nan)
        self.final = {key: np.full((b, n, width), np.nan) for key, width in KINEMATICS.items()}
        self.present = np.zeros((b, n), dtype=bool)
        self.left_at = np.full((b, n, 3), np.nan)
        self.monitors = {key: np.full(b, np.nan) for key in MONITORS}
        self.monitors |= {f"energy_{key}": np.full(b, np.nan) for key in ENERGIES}
        longest = max(self.plans, key=lambda plan: plan.steps)
        t = 0 if frames is None else longest.steps // frames + 1
        if b * t * n * 13 * 8 > MOST_BYTES:
            raise CaromError(
                f"simulate_batch: {t} frames of {n} balls in {b} cases are more than {MOST_BYTES >> 30} GiB;"
                " keep fewer (frames=...) or give the cases in several calls"
            )
        self.frame_time = (np.arange(t) * (frames or 1)).astype(
            np.float64
        ) * longest.step  # as the core has it
        self.frames = {key: np.full((b, t, n, width), np.nan) for key, width in KINEMATICS.items() if t}
        self.tables: dict[str, list[dict[str, Array] | None]] = {name: [None] * b for name in TABLES}
        self.stop = threading.Event()
        self.done = 0
        self.broken: BaseException | None = None
        self._lock = threading.Lock()
        self._next = iter(range(b))

    def run(self, threads: int, progress: Callable[[int, int], None] | None) -> Batch:
        threads = max(1, min(threads, self.cases))
        start = time.perf_counter()
        workers = [threading.Thread(target=self._work, daemon=True) for _ in range(threads)]
        for worker in workers:
            worker.start()
        try:
            for worker in workers:
                while worker.is_alive():
                    worker.join(0.1)
                    if progress is not None and worker.is_alive():
                        progress(self.done, self.cases)
            if progress is not None and self.broken is None:
                progress(self.done, self.cases)
        except BaseException as error:  # Ctrl-C, or the callback: what is there goes with it
            self.stop.set()
            for worker in workers:
                worker.join()
            error.result = self._batch(threads, time.perf_counter() - start)  # type: ignore[attr-defined]
            raise
        if self.broken is not None:
            self.broken.result = self._batch(threads, time.perf_counter() - start)  # type: ignore[attr-defined]
            raise self.broken
        return self._batch(threads, time.perf_counter() - start)

    def _work(self) -> None:
        while not self.stop.is_set():
            with self._lock:
                case = next(self._next, None)
            if case is None:
                return
            try:
                self._one(case)
            except CaromError as error:
                self._note(case, "bad_scene", str(error))
            except (
                BaseException
            ) as error:  # a fault of Carom's own, or of a load function: not for one case alone
                self._break(error)
            with self._lock:
                self.done += 1

    def _break(self, error: BaseException) -> None:
        """End the batch: what failed is not a fault of one case."""
        self.broken = error
        self.stop.set()

    def _note(self, case: int, kind: str, message: str) -> None:
        self.outcome[case], self.message[case] = kind, message

    def _one(self, case: int) -> None:
        if self.overrides is None:
            scene, plan = self.scenes[case], self.plans[case]
            scene.validate()
            model = scene.to_model()
        else:
            plan, model = self.plans[0], self.overrides.model(case)
        # One thread for each case; results do not depend on it.
        model = {**model, "options": {**model["options"], "threads": 1}}
        if not self.keep_impacts:
            model["drop_impacts"] = True
        else:
            model.pop("drop_impacts", None)
        try:
            simulation = begin(model)
        except CaromError as error:
            self._note(case, "bad_model", str(error))
            return
        overlap = simulation.overlaps(touching(model["options"]), 1)
        if overlap:
            a, b, gap = overlap[0]
            names = self.bodies[0 if self.overrides is not None else case]
            self._note(case, "overlap", f"{names[a]} and {names[b]} overlap by {-gap:.3g} m at the start")
            return
        kept = _Kept({key: values[case] for key, values in self.frames.items()}, plan)
        sinks: list[Sink] = [kept]
        watch = copy.deepcopy(self.watch)  # a condition may remember: one for each case
        if watch is not None:
            watch.begin(self.names, model, plan)
            sinks.append(watch)
        outcome = drive(simulation, plan, sinks, self.stop.is_set).outcome
        if watch is not None and watch.error is not None:
            self._break(watch.error)
        elif outcome["kind"] in ENDED:
            self._keep(case, simulation, kept.tables)
            self._note(case, str(outcome["kind"]), str(outcome.get("message", "")))
        elif outcome["kind"] != "interrupted":  # the batch itself was stopped
            where = f"at step {outcome.get('step')}, t = {outcome.get('time', float('nan')):g} s"
            self._note(case, str(outcome["kind"]), f"{where}; {outcome.get('advice', '')}".rstrip("; "))

    def _keep(self, case: int, simulation: Simulation, tables: Mapping[str, list[Mapping[str, Any]]]) -> None:
        frame, totals = simulation.frame(), simulation.monitors()
        self.time[case] = frame["time"]
        for key, values in self.final.items():
            values[case] = frame[key]
        self.present[case] = frame.get("present", True)
        for key in MONITORS:
            self.monitors[key][case] = totals[key]
        for key in ENERGIES:
            self.monitors[f"energy_{key}"][case] = totals["energy"][key]
        for name, blocks in tables.items():
            if blocks and (name == "events" or self.keep_impacts):
                self.tables[name][case] = {
                    column: np.concatenate([np.asarray(b[column]) for b in blocks]) for column in blocks[0]
                }
        events = self.tables["events"][case]
        if events is not None:
            gone = np.asarray(events["body"])[np.asarray(events["kind"]) == 0].astype(np.int64)
            # The frame has NaN for balls that are absent; the state keeps where they stood last.
            self.left_at[case, gone] = simulation.state()["position"][gone]

    def _table(self, name: str) -> dict[str, Array]:
        """All tables of a kind end to end, the case in front."""
        found = [(case, table) for case, table in enumerate(self.tables[name]) if table is not None]
        if not found:
            return {}
        columns = {column: np.concatenate([table[column] for _, table in found]) for column in found[0][1]}
        rows = [len(table["step"]) for _, table in found]
        return {"case": np.repeat([case for case, _ in found], rows), **columns}

    def _batch(self, threads: int, wall_s: float) -> Batch:
        return Batch(
            names=self.names,
            outcome=self.outcome,
            message=self.message,
            time=self.time,
            **self.final,
            present=self.present,
            left_at=self.left_at,
            monitors=self.monitors,
            parameters={} if self.overrides is None else self.overrides.values,
            impacts=self._table("impacts"),
            events=self._table("events"),
            transitions=self._table("transitions"),
            frame_time=self.frame_time,
            frames=self.frames,
            wall_s=wall_s,
            threads=threads,
            _scenes=self.scenes,
            _overrides=self.overrides,
        )
