"""Checkpoints: the whole state of a run in a small file of its own, from which it continues bit for bit.

A checkpoint is a plain `.npz` without pickles. The state, a tree of dicts, lists, arrays and numbers, is laid
out as arrays `0`, `1`, ... and a JSON description that refers to them; a SHA-256 over all of it tells a torn
or altered file from a whole one. It is written to a temporary file, forced to the disk and renamed; the last
two are kept, so that even a damaged newest one costs only the time since the one before. Which of them a run
continues from is decided in `carom.run.restart`.
"""

from __future__ import annotations

import functools
import hashlib
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom import _core
from carom.arrays import Array
from carom.errors import CaromError
from carom.files import reason, regular, write_whole
from carom.result.record.layout import Rows

#: 2: with the version and the build that wrote it.
FORMAT = 2
KEEP = 2


@dataclass(frozen=True)
class Checkpoint:
    """A saved state: what `Simulation.restore` takes, the step it belongs to and the rows recorded up to it."""

    step: int
    time: float
    rows: Rows
    scenario: str  # SHA-256 of what the state depends on; another scene must not continue it
    state: Mapping[str, Any]
    version: str = ""  # of the core that computed it
    build: str = ""  # and of its machine code, if it is known
    spent: tuple[float, float] = (
        0.0,
        0.0,
    )  # `wall_s` and `core_s` of the part of the run that wrote it, so far


def save(directory: Path, checkpoint: Checkpoint) -> Path:
    """Write `checkpoint-<step>.npz` so that a crash at any moment leaves either the old files or the new one whole."""
    arrays: list[Array] = []
    head = {
        "format": FORMAT,
        "step": checkpoint.step,
        "time": checkpoint.time,
        "rows": list(checkpoint.rows),
        "scenario": checkpoint.scenario,
        "version": checkpoint.version,
        "build": checkpoint.build,
        "spent": checkpoint.spent,
        "state": _pack(checkpoint.state, arrays),
    }
    text = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    members = {str(i): array for i, array in enumerate(arrays)}
    buffer = BytesIO()
    np.savez(buffer, head=text, sha256=np.frombuffer(_digest(text, arrays), dtype=np.uint8), **members)  # type: ignore[arg-type]
    path = directory / name(checkpoint.step)
    write_whole(path, buffer.getbuffer(), durable=True)
    for old in found(directory)[KEEP:]:
        old.unlink(missing_ok=True)
    return path


def name(step: int) -> str:
    """The file of the checkpoint after `step`; names sort as steps do."""
    return f"checkpoint-{step:012d}.npz"


def found(directory: Path) -> list[Path]:
    """The checkpoints of a run directory, newest first."""
    return sorted(directory.glob("checkpoint-*.npz"), reverse=True)


def load(path: Path) -> Checkpoint:
    """Read one checkpoint; a torn or altered file is a `CaromError`."""
    try:
        with np.load(regular(path), allow_pickle=False) as archive:  # noqa: TID251
            text, digest = archive["head"], archive["sha256"].tobytes()
            arrays = [archive[str(i)] for i in range(len(archive.files) - 2)]
        if _digest(text, arrays) != digest:
            raise ValueError("its checksum does not match")
        head = json.loads(text.tobytes())
        if head["format"] != FORMAT:
            raise ValueError(f"it has format {head['format']}, wanted {FORMAT}")
        rows, state = Rows(*head["rows"]), _unpack(head["state"], arrays)
        wall_s, core_s = (float(seconds) for seconds in head.get("spent", (0.0, 0.0)))
        found = Checkpoint(
            head["step"],
            head["time"],
            rows,
            head["scenario"],
            state,
            head["version"],
            head["build"],
            (wall_s, core_s),
        )
        texts, counts = (found.scenario, found.version, found.build), (found.step, *found.rows)
        if not (
            isinstance(found.state, dict)
            and isinstance(found.time, int | float)
            and all(isinstance(text, str) for text in texts)
            and all(isinstance(count, int) and count >= 0 for count in counts)
        ):
            raise ValueError("its state is not one of a run")
        return found
    except _DAMAGE as error:
        told = reason(error)
        if not told.startswith("it") and getattr(error, "errno", None) is None:
            told = f"it is damaged ({told})"
        raise CaromError(f"checkpoint {path} cannot be used: {told}") from error


#: What NumPy, zipfile and the code above raise of a file that was cut or altered.
_DAMAGE = (
    *(OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, EOFError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError),
)


@functools.cache
def build() -> str:
    """The identity that the linker gave the compiled core; empty where it gave none.

    Two builds of one version may differ, as of sources that were changed in between.
    """
    note = b"\x04\0\0\0\x14\0\0\0\x03\0\0\0GNU\0"  # NT_GNU_BUILD_ID of an ELF file, 20 bytes
    try:
        with open(_core.__file__, "rb") as file:
            head = file.read(4096)
    except (AttributeError, TypeError, OSError):
        return ""
    at = head.find(note)
    return head[at + len(note) : at + len(note) + 20].hex() if at >= 0 else ""


def _digest(head: NDArray[np.uint8], arrays: list[Array]) -> bytes:
    digest = hashlib.sha256(head.tobytes())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()


def _pack(value: Any, arrays: list[Array]) -> Any:
    """JSON for a tree of values. Bits must survive: arrays go aside as they are, floats as hexadecimal text."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("a state holds plain arrays only")
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        arrays.append(np.asarray(value))
        return {"scalar": len(arrays) - 1}
    if isinstance(value, Mapping):
        return {"dict": [[_pack(k, arrays), _pack(v, arrays)] for k, v in value.items()]}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [_pack(v, arrays) for v in value]}
    if isinstance(value, (bytes, bytearray)):
        return {"bytes": bytes(value).hex()}
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return {"float": value.hex()}
    raise TypeError(f"a state cannot hold a {type(value).__name__}")


def _unpack(value: Any, arrays: list[Array]) -> Any:
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    if kind == "array":
        return arrays[content]
    if kind == "scalar":
        return arrays[content][()]
    if kind == "dict":
        return {_unpack(k, arrays): _unpack(v, arrays) for k, v in content}
    if kind == "list":
        return [_unpack(v, arrays) for v in content]
    if kind == "tuple":
        return tuple(_unpack(v, arrays) for v in content)
    if kind == "bytes":
        return bytes.fromhex(content)
    if kind == "float":
        return float.fromhex(content)
    raise ValueError(f"it holds an unknown kind of value, {kind}")
