"""Write the page: facts of the run, its motion, the viewer, and a policy that forbids any request."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError
from carom.files import write_whole
from carom.result.data import RunData
from carom.result.remarks import remarks
from carom.scene.billiards.look import COLOURS
from carom.scene.billiards.marked import table_of
from carom.scene.billiards.shape import Shape
from carom.show.viewer import codec
from carom.show.viewer.happenings import happenings
from carom.show.viewer.links import links
from carom.show.viewer.scenery import bounds, deforming, held, period, scenery
from carom.show.viewer.table import ball_facts, packed_table, table_facts

FORMAT = 1
# A browser holds 20 bytes of each body in each frame; more than this and a laptop begins to swap.
MAX_BODY_FRAMES = 10_000_000
# Recorded velocities double the page, so large runs go without and the page takes differences.
MAX_BODY_FRAMES_WITH_VELOCITY = 400_000
# Below this many frames motion is no longer motion, and bodies are left out instead.
MIN_FRAMES = 50
MAX_MARKS = 2000
# Read at a time: of very many bodies the frames that are shown do not fit the memory before bodies are left out.
READ_NUMBERS = 6_000_000


@dataclass(frozen=True)
class ViewInfo:
    """What was written. `notes` says in words what was left out, and the page says the same."""

    path: Path
    bytes: int
    frames: int
    frames_recorded: int
    bodies: int
    bodies_recorded: int
    notes: tuple[str, ...] = ()


def write_html(
    result: RunData, path: str | os.PathLike[str], *, title: str | None = None, max_mb: float = 100.0
) -> ViewInfo:
    """Write `result` as one HTML file that opens offline, of `max_mb` megabytes (1e6 bytes) at most.

    A run that does not fit is thinned, frames first and bodies only if it must be; the page and the
    returned `ViewInfo.notes` say so.
    """
    target = Path(path)
    if target.is_dir():
        raise CaromError(f"{target} is a directory; name a file, as {target / 'view.html'}")
    shell = _Shell.load()
    least = shell.size + 120_000
    if not least <= max_mb * 1e6 < math.inf:
        raise CaromError(
            f"a page of {max_mb:g} MB leaves no room for motion; give --max-mb (max_mb in Python) at least"
            f" {math.ceil(least / 1e4) / 100:g}"
        )
    title = title or result.title or "Carom"
    budget = int(max_mb * 1e6) - shell.size - 20_000

    shape = tuple(result.position.shape)
    _check(result, shape)
    frames_recorded, bodies_recorded = shape[:2]
    # Thinning is a search: how well frames compress depends on how far apart they are.
    stride = max(1, -(-frames_recorded * bodies_recorded // MAX_BODY_FRAMES))
    every = 1
    while True:
        if frames_recorded / stride < MIN_FRAMES and stride > 1:
            every = max(every, -(-stride * MIN_FRAMES // frames_recorded))
            stride = max(1, frames_recorded // MIN_FRAMES)
        facts, packed = _pack(result, stride, every, title, budget)
        size = len(packed) * 4 // 3 + len(facts["names"]) * 40
        if size <= budget or (every >= bodies_recorded and stride >= frames_recorded):
            break
        factor = size / budget * 1.05
        if frames_recorded / stride > MIN_FRAMES:
            stride = max(stride + 1, int(np.ceil(stride * factor)))
        else:
            every = max(every + 1, int(np.ceil(every * factor)))

    frames, bodies = facts["arrays"]["time"]["shape"][0], len(facts["names"])
    notes = _notes(frames, frames_recorded, stride, bodies, bodies_recorded, every, max_mb)
    if "velocity" not in facts["arrays"]:
        notes.append("Velocities and spins are differences between frames.")
    ended = [] if result.outcome.ok else [f"Not finished: {result.outcome.where}."]
    facts["notes"] = notes = ended + _warnings(result) + notes + facts["notes"]
    text = shell.fill(title, json.dumps(facts, separators=(",", ":")), packed)
    write_whole(target, text, durable=False, parents=True)  # a full disk leaves the old page in place
    return ViewInfo(target, len(text), frames, frames_recorded, bodies, bodies_recorded, tuple(notes))


def _warnings(result: RunData) -> list[str]:
    """What a reader should know before looking, as sentences."""
    try:
        return [f"{told[0].upper()}{told[1:]}." for told in remarks(result)]
    except CaromError:  # does not keep the motion from being seen
        return ["Warnings of the run are left out: its copy of the scenario cannot be read."]


def _check(result: RunData, shape: tuple[int, ...]) -> None:
    if len(shape) != 3 or shape[2] != 3:
        raise CaromError(f"positions must be (frame, body, 3), got {shape}")
    if shape[0] == 0 or shape[1] == 0:
        raise CaromError(f"nothing to show: the run has {shape[0]} frames and {shape[1]} bodies")
    radius = np.asarray(result.bodies["radius"], dtype=np.float64)
    if radius.shape != (shape[1],) or not (np.isfinite(radius) & (radius > 0.0)).all():
        raise CaromError(f"every one of the {shape[1]} bodies needs a positive radius")


def _pack(result: RunData, stride: int, every: int, title: str, budget: int) -> tuple[dict[str, Any], bytes]:
    """The facts (all that is not motion) and the gzip'd motion, of every `stride`-th frame."""
    recorded = result.position.shape[0]
    bodies = slice(None, None, every)
    extra = (recorded - 1) % stride > 0  # the last frame is always in
    frames = np.append(np.arange(0, recorded, stride), [recorded - 1] if extra else []).astype(np.int64)

    def read(array: Any, columns: slice) -> Array:
        size = max(
            1, READ_NUMBERS * stride // max(1, int(np.prod(array.shape[1:])))
        )  # some frames, of all bodies
        size += -size % stride
        parts = [np.asarray(array[k : k + size : stride])[:, columns] for k in range(0, recorded, size)]
        return np.concatenate([*parts, np.asarray(array[-1:])[:, columns]] if extra else parts)

    def read_bodies(name: str) -> F64:
        values = read(getattr(result, name), bodies).astype(np.float64)
        return _finite(values if present is None else held(values, present), name, names, time)

    names = [str(name) for name in result.names][bodies]
    radius = np.asarray(result.bodies["radius"], dtype=np.float64)[bodies]
    time = np.asarray(result.time[:])[frames].astype(np.float64)
    there = read(result.present, bodies).astype(bool)
    present = None if there.all() else there
    fold = period(result)
    chunks: list[bytes] = [time.astype("<f8").tobytes()]
    arrays: dict[str, Any] = {"time": {"shape": [len(time)]}}

    def add(name: str, integers: codec.Integers, **entry: Any) -> None:
        data, how = codec.encode(integers)
        arrays[name] = {"offset": sum(map(len, chunks)), "bytes": len(data), **how, **entry}
        chunks.append(data)

    position = read_bodies("position")
    origin, step = codec.position_grid(position, radius)
    add("position", codec.quantise(position, step, origin), step=step, origin=origin.tolist())
    boxes = deforming(result)
    low, high = bounds(position, present, fold, boxes)
    if present is not None:
        add("present", present[..., np.newaxis].astype(np.int32))
    add(
        "orientation",
        codec.orientation_integers(read_bodies("orientation")),
    )
    if position.shape[0] * position.shape[1] <= MAX_BODY_FRAMES_WITH_VELOCITY:
        for name in ("velocity", "angular_velocity"):
            rate = read_bodies(name)
            step = max(float(np.abs(rate).max()), 1e-300) / 2**20
            add(name, codec.quantise(rate, step, np.zeros(3)), step=step)

    table = table_of(result)
    shape = None if table is None else Shape(table)
    if shape is not None:
        for name, integers, entry in packed_table(shape, origin):
            add(name, integers, **entry)
    set_up = scenery(result, frames, () if shape is None else shape.walls)
    if set_up.position.size:
        corner, step = codec.position_grid(set_up.position, radius)
        add("wall_position", codec.quantise(set_up.position, step, corner), step=step, origin=corner.tolist())
        add("wall_orientation", codec.orientation_integers(set_up.orientation))

    happened = happenings(result, frames, every, 0.75 * budget)
    for name, values in happened.columns.items():
        add(name, values)
    rows = {} if boxes is None or boxes.rows is None else {"boxes": boxes.rows[frames].ravel()}
    for name, doubles in {**happened.doubles, **rows}.items():
        arrays[name] = {"offset": sum(map(len, chunks)), "shape": [len(doubles)]}
        chunks.append(doubles.astype("<f8").tobytes())
    tied = links(result, every)

    facts = {
        "format": FORMAT,
        "title": title,
        "names": names,
        "radius": [float(f"{r:.9g}") for r in radius],
        "box": [low.tolist(), high.tolist()],
        "planes": set_up.planes,
        **({"walls": set_up.walls} if set_up.walls else {}),
        **({"table": table_facts(shape)} if shape is not None else {}),
        "colours": COLOURS,
        **ball_facts(result, table, every),
        **({"period": fold} if fold is not None else {}),
        **({} if boxes is None else {"shear": [boxes.first.flow, boxes.first.gradient]}),
        **({"links": tied} if tied else {}),
        **happened.facts,
        "notes": happened.notes,
        "gravity": (result.gravity if result.gravity.any() else -np.eye(3)[2]).tolist(),
        "marks": _marks(result, time),
        "arrays": arrays,
    }
    return facts, gzip.compress(b"".join(chunks), compresslevel=9, mtime=0)


def _finite(values: F64, what: str, names: Sequence[str], time: F64) -> F64:
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        frame, body = bad[0][:2]
        raise CaromError(f"{what} of {names[body]} is not a number at t = {time[frame]:g} s")
    return values


def _marks(result: RunData, time: F64) -> list[float]:
    """Times of impacts, as ticks over the scrub bar; a run with a great many has none worth showing."""
    times = np.unique(np.round(np.asarray(result.impacts["time"], dtype=np.float64), 9))
    times = times[(times >= time[0]) & (times <= time[-1])]
    return [] if len(times) > MAX_MARKS else [float(t) for t in times]


def _notes(
    frames: int,
    frames_recorded: int,
    stride: int,
    bodies: int,
    bodies_recorded: int,
    every: int,
    max_mb: float,
) -> list[str]:
    notes = []
    if frames < frames_recorded:
        notes.append(f"Shows {frames} of {frames_recorded} frames (one in {stride}).")
    if bodies < bodies_recorded:
        notes.append(f"Shows {bodies} of {bodies_recorded} bodies (one in {every}).")
    if notes:
        notes.append(f"Thinned to keep the page below {max_mb:g} MB and light on memory.")
    return notes


@dataclass(frozen=True)
class _Shell:
    """The page without a run: markup, style and program, as they lie in the package."""

    template: str
    style: str
    program: str

    @classmethod
    def load(cls) -> _Shell:
        assets = files("carom.show.viewer") / "assets"
        template, style, program = (
            # Hashes are taken of what the browser sees, and it turns CR LF into LF.
            (assets / name).read_bytes().decode().replace("\r\n", "\n")
            for name in ("template.html", "viewer.css", "viewer.js")
        )
        for text, tag in ((style, "</style"), (program, "</script"), (program, "<!--")):
            if tag in text.lower():
                raise CaromError(f"the viewer's assets hold {tag!r}, which would end the element early")
        return cls(template, style, program)

    @property
    def size(self) -> int:
        return len((self.template + self.style + self.program).encode())

    def fill(self, title: str, facts: str, packed: bytes) -> bytes:
        policy = "; ".join(
            [
                "default-src 'none'",
                f"script-src {_hash(self.program)}",
                f"style-src {_hash(self.style)}",
                "img-src data: blob:",
                "connect-src 'none'",  # as by default; said for readers, and should a browser widen the default
                "base-uri 'none'",
                "form-action 'none'",
            ]
        )
        parts = {
            "title": html.escape(title),
            "policy": policy,
            "style": self.style,
            "program": self.program,
            "facts": facts.replace("<", "\\u003c"),  # a body named "</script>" is still only a name
            "motion": base64.b64encode(packed).decode(),
        }
        return re.sub(r"\{\{(\w+)\}\}", lambda m: parts[m[1]], self.template).encode()


def _hash(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() + "'"
