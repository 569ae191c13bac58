"""Damaged inputs from good ones. Every function takes a generator of random numbers, so that a seed gives the same cases."""

from __future__ import annotations

import io
import json
import random
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fuzz.material import FILES

#: Values that readers trip over: too large, too small, no numbers at all, of another type, endless.
NASTY = (
    *("0", "-1", "1", "0.5", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "1e999", "nan", "inf", "-inf"),
    *("1e9", "1e12", "1e18", "9223372036854775807", "9223372036854775808", "-9223372036854775808", "1e30"),
    *("1" + "0" * 30, "1" + "0" * 400, "0x" + "f" * 5000, "1_0", "0b1", "true", "false", '""', '"m"', "'x'"),
    *('"1 m"', '"1e400 m"', '"-1 kg"', '"nan s"', '"= 1/0"', '"= 2^99999"', '"= x"', '"= sqrt(-1)"', '"= "'),
    *("2026-01-01", "12:30:00", "[]", "[[]]", "{}", "{ expression = 't' }", "{ expression = '1/(t-0.001)' }"),
    *("[0, 0, 0]", "[nan, 0, 0]", "[1e308, 1e308, 1e308]", "[1e9, 1e9, 1e9]", "[1000000000, 1000000000, 1]"),
    *(
        "[1000000, 1000000, 1000000]",
        "{ table = [[0, 0], [0, 1]] }",
        '"\\u0000"',
        '"\\u202e"',
        '"' + "x" * 300 + '"',
    ),
    *(
        '"ball"',
        '"ground"',
        '"all"',
        '"plane"',
        "[1, 2]",
        '["a", "a"]',
        "'''\n'''",
        "{ a = { b = { c = 1 } } }",
    ),
    *(
        "[" * 200 + "]" * 200,
        "{ a = " * 100 + "1" + "}" * 100,
        '"' + "é" * 50 + '"',
        '"= ' + "(" * 100 + '1"',
    ),
)
SECTIONS = (
    *(
        "run",
        "record",
        "world",
        "material",
        "contact",
        "sphere",
        "rack",
        "lattice",
        "clump",
        "packing",
        "plane",
        "box",
    ),
    *(
        "cylinder",
        "ball_wall",
        "cone",
        "inflow",
        "outlet",
        "load",
        "spring",
        "drag",
        "joint",
        "load_function",
    ),
    *("parameters", "case", "format", "title", "x", "é"),
)
_VALUE = re.compile(r"(?m)^(\s*[A-Za-z_][\w.-]*\s*=\s*)([^\n#]+)")
_NUMBER = re.compile(r"(?<![\w.\"])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")
#: Sections that pieces of other scenarios are taken from.
_TABLE = re.compile(r"(?ms)^\[\[?[\w.]+\]\]?.*?(?=^\[|\Z)")


def scenario(r: random.Random, good: list[bytes]) -> bytes:
    """A scenario with one to four mistakes, on the level of text."""
    text = r.choice(good).decode()
    for _ in range(r.choice((1, 1, 1, 2, 4))):
        text = r.choice(_OF_TEXT)(r, text, good)
    data = text.encode("utf-8", errors="surrogatepass")
    return damaged(r, data) if r.random() < 0.1 else data


def _value(r: random.Random, text: str, good: list[bytes]) -> str:
    """Another value for a key."""
    found = list(_VALUE.finditer(text))
    if not found:
        return text
    match = r.choice(found)
    return text[: match.start(2)] + r.choice(NASTY) + text[match.end(2) :]


def _number(r: random.Random, text: str, good: list[bytes]) -> str:
    """Another number in the place of one, or the number changed a little or a lot."""
    found = list(_NUMBER.finditer(text))
    if not found:
        return text
    match = r.choice(found)
    x = match[0]
    other = r.choice(
        (f"-{x}", f"{x}0", f"{x}e9", f"{x}e-9", "0", "1e-300", "nan", r.choice(NASTY), x[:-1], "1e17")
    )
    return text[: match.start()] + other + text[match.end() :]


def _line(r: random.Random, text: str, good: list[bytes]) -> str:
    """A line removed, doubled, or moved to another place."""
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    k = r.randrange(len(lines))
    what = r.randrange(4)
    if what == 0:
        del lines[k]
    elif what == 1:
        lines.insert(k, lines[k])
    else:
        lines.insert(r.randrange(len(lines)), lines.pop(k))
    return "".join(lines)


def _cut(r: random.Random, text: str, good: list[bytes]) -> str:
    """The end is missing."""
    return text[: r.randrange(len(text) + 1)]


def _key(r: random.Random, text: str, good: list[bytes]) -> str:
    """Another name for a key or table."""
    words = list(re.finditer(r"[A-Za-z_]+", text))
    if not words:
        return text
    match = r.choice(words)
    other = r.choice((*SECTIONS, match[0] + "x", match[0][:-1], match[0].upper(), r.choice(words)[0]))
    return text[: match.start()] + other + text[match.end() :]


def _graft(r: random.Random, text: str, good: list[bytes]) -> str:
    """A table of another scenario besides."""
    tables = _TABLE.findall(r.choice(good).decode())
    return text + "\n" + r.choice(tables) if tables else text


def _character(r: random.Random, text: str, good: list[bytes]) -> str:
    """A strange character somewhere."""
    k = r.randrange(len(text) + 1)
    return (
        text[:k] + r.choice("\0\x07\x1b\"'[]{}=.,#\\\n\r\t\u00e9\u202e\u2028\ufeff\U0001f600-+e") + text[k:]
    )


def _repeat(r: random.Random, text: str, good: list[bytes]) -> str:
    """A table many times."""
    tables = _TABLE.findall(text)
    return text + r.choice(tables) * r.choice((1, 2, 50)) if tables else text


_OF_TEXT = (_value, _value, _value, _number, _number, _line, _cut, _key, _graft, _character, _repeat)


def damaged(r: random.Random, data: bytes) -> bytes:
    """Bytes flipped, overwritten, cut or inserted, at one to sixteen places."""
    out = bytearray(data)
    for _ in range(r.choice((1, 1, 2, 4, 16))):
        if not out:
            break
        k = r.randrange(len(out))
        what = r.randrange(8)
        if what < 3:
            out[k] ^= 1 << r.randrange(8)
        elif what < 5:
            out[k] = r.choice((0, 1, 0x7F, 0x80, 0xFF, r.randrange(256)))
        elif what == 5:
            n = r.choice((2, 4, 8))
            out[k : k + n] = r.choice(
                (b"\xff" * n, b"\0" * n, b"\x7f" + b"\xff" * (n - 1), b"\x01" + b"\0" * (n - 1))
            )
        elif what == 6:
            del out[k : k + r.choice((1, 8, 512, len(out)))]
        else:
            out[k:k] = bytes(r.randrange(256) for _ in range(r.choice((1, 8, 64))))
    return bytes(out)


# --- HDF5, by its structure ---------------------------------------------------------------------------------------


def hdf5(r: random.Random, good: bytes) -> bytes:
    """A valid HDF5 file that is not what the reader expects: one to three objects changed."""
    image = io.BytesIO(good)
    with h5py.File(image, "r+", libver="latest") as file:
        for _ in range(r.choice((1, 1, 1, 2, 3))):
            names: list[str] = []
            file.visit(names.append)
            if not names:
                break
            _change(r, file, r.choice(names))
    return image.getvalue()


def _change(r: random.Random, file: h5py.File, name: str) -> None:
    old = file.get(name, getlink=False)
    if old is None:
        return
    what = r.randrange(14)
    if what == 0 and old.attrs and r.random() < 0.5:
        key = r.choice(list(old.attrs))
        del old.attrs[key]
        if r.random() < 0.7:
            old.attrs[key] = r.choice(
                (-1, 1e300, float("nan"), "x", [1, 2, 3], np.zeros((2, 2)), [2**63 - 1] * 7)
            )
        return
    attributes: dict[str, Any] = dict(old.attrs)
    data = (
        old[()]
        if isinstance(old, h5py.Dataset) and old.shape is not None and old.size < 10_000
        else np.zeros(3)
    )
    del file[name]
    if what == 1:
        return
    if what == 2:
        file[name] = h5py.SoftLink(r.choice(("/nowhere", "/" + name, "/", name)))
    elif what == 3:
        files = ("/dev/zero", "/etc/passwd", "case.hdf5", "results.h5", "no.h5")
        file[name] = h5py.ExternalLink(r.choice(files), r.choice(("/", name)))
    elif what == 4:
        file.create_group(name)
    elif what == 5:
        file.create_dataset(
            name, shape=r.choice(((10**12,), (2**40, 3), (10**6, 10**6))), dtype="f8", chunks=True
        )
    elif what == 6:
        texts = [str(x) for x in np.ravel(data)]
        file.create_dataset(name, (len(texts),), dtype=h5py.string_dtype(), data=texts)
    elif what == 7:
        file.create_dataset(name, (2,), dtype=h5py.vlen_dtype(np.dtype("f8")))
    elif what == 8:
        file.create_dataset(name, data=h5py.Empty("f8"))
    elif what == 9:
        file.create_dataset(name, data=np.zeros(3, dtype=[("a", "i4"), ("b", "f8")]))
    elif what == 10:
        shape = tuple(n + r.choice((-1, 1, 5)) for n in data.shape) if data.shape else (4,)
        file.create_dataset(name, data=np.zeros([max(0, n) for n in shape], dtype="f8"))
    elif what == 11:
        file.create_dataset(name, shape=(1000,), dtype="f8", external=[("/dev/zero", 0, 8000)])
    elif what == 12:
        layout = h5py.VirtualLayout(shape=(10,), dtype="f8")
        layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=(10,))
        file.create_virtual_dataset(name, layout)
    else:
        values = np.array(data, copy=True)
        if values.size and values.dtype.kind in "fiu":
            k = r.randrange(values.size)
            info = None if values.dtype.kind == "f" else np.iinfo(values.dtype)
            nasty = (np.nan, np.inf, 1e308, -1e308, 0, -1) if info is None else (info.min, info.max, 0, 1)
            values.reshape(-1)[k] = r.choice(nasty)
        file.create_dataset(
            name, data=values, maxshape=(None,) * values.ndim if values.ndim and values.size else None
        )
    if what > 3 and r.random() < 0.8:
        for key, value in attributes.items():
            file[name].attrs[key] = value


def problem(r: random.Random, good: list[bytes]) -> bytes:
    """A file of a contact problem, damaged in its bytes or in its structure."""
    data = r.choice(good)
    return damaged(r, data) if r.random() < 0.4 else hdf5(r, data)


# --- runs and checkpoints -----------------------------------------------------------------------------------------


def result(r: random.Random, run: Path, weights: tuple[int, ...] = (8, 2, 1, 0)) -> bytes:
    """A file of a run, with its number in `material.FILES` before it."""
    which = r.choices(range(len(FILES)), weights)[0]
    good = (run / FILES[which]).read_bytes()
    if FILES[which].startswith("checkpoint"):
        bad = checkpoint(r, good)
    elif which == 0:
        bad = damaged(r, good) if r.random() < 0.4 else hdf5(r, good)
    elif which == 1 and r.random() < 0.7:
        bad = json.dumps(_tree(r, json.loads(good))).encode()
    else:
        bad = damaged(r, good)
    return bytes([which]) + bad


def _tree(r: random.Random, tree: Any) -> Any:
    """JSON with one value changed."""
    at, place = tree, None
    while isinstance(at, dict | list) and at and (place is None or r.random() < 0.8):
        place = (at, r.choice(list(at)) if isinstance(at, dict) else r.randrange(len(at)))
        at = place[0][place[1]]
    if place is not None:
        where, key = place
        if r.random() < 0.2 and isinstance(where, dict):
            del where[key]
        else:
            where[key] = r.choice((None, 0, -1, 1e300, "x", [], {}, [[]], True, {"kind": 3}, 10**30))
    return tree


def checkpoint(r: random.Random, good: bytes) -> bytes:
    """A checkpoint with other bytes, or one whose checksum holds and whose description does not."""
    if r.random() < 0.5:
        return damaged(r, good)
    from carom.run import checkpoint as module

    with np.load(io.BytesIO(good), allow_pickle=False) as archive:
        arrays = [archive[str(i)] for i in range(len(archive.files) - 2)]
        head = json.loads(archive["head"].tobytes())
    head = _tree(r, head)
    text = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    if arrays and r.random() < 0.5:
        k = r.randrange(len(arrays))
        arrays[k] = array(r, arrays[k])
    buffer = io.BytesIO()
    members: dict[str, Any] = {str(i): a for i, a in enumerate(arrays)}
    np.savez(buffer, head=text, sha256=np.frombuffer(module._digest(text, arrays), dtype=np.uint8), **members)
    return buffer.getvalue()


def array(r: random.Random, good: np.ndarray) -> np.ndarray:
    """An array of another shape, type or value."""
    what = r.randrange(6)
    if what == 0:
        return np.zeros(r.choice(((0,), (1,), (2, 3), (5, 9), ())), dtype=good.dtype)
    if what == 1:
        return good.astype(r.choice(("f4", "i8", "u8", "U5", "c16", "?")))
    if what == 2:
        return np.concatenate([good, good]) if good.ndim else good
    if what == 3:
        return good.reshape(-1)
    values = np.array(good, copy=True)
    if values.size:
        k = r.randrange(values.size)
        huge = (
            (np.nan, np.inf, 1e308, -1e200, 0.0)
            if values.dtype.kind == "f"
            else (0, 1, 7, 2**31, 2**32, 2**62)
        )
        values.reshape(-1)[k] = r.choice(huge)
    return values


def state(r: random.Random, arrays: dict[str, np.ndarray]) -> bytes:
    """One array of a state, changed, as the target `state` takes it."""
    name = r.choice(sorted(arrays))
    buffer = io.BytesIO()
    np.savez(buffer, value=array(r, np.asarray(arrays[name])))
    return json.dumps({"name": name}).encode() + b"\n" + buffer.getvalue()


# --- expressions --------------------------------------------------------------------------------------------------

_TERMS = (
    "t",
    "v",
    "pi",
    "1",
    "0",
    "1e308",
    "1e-308",
    "2.5",
    "0.1",
    "x1",
    "1e999",
    ".5",
    "5.",
    "0x1",
    "é",
    "t t",
    "",
)
#: Characters of a formula at most: more than the parser takes.
LONGEST = 9000
_OPERATORS = ("+", "-", "*", "/", "^", "**", "<", ">", "==", ",", "%", "&", "//", " ", "=", "!")


def expression(r: random.Random, functions: list[str], depth: int = 0) -> str:
    """A formula by the grammar, or nearly so."""
    if depth > r.choice((1, 3, 6)):
        return r.choice(_TERMS)
    what = r.randrange(10)
    inner = expression(r, functions, depth + 1)
    if what < 4:
        return f"{inner}{r.choice(_OPERATORS)}{expression(r, functions, depth + 1)}"[:LONGEST]
    if what < 7:
        more = "".join(f",{expression(r, functions, depth + 1)}" for _ in range(r.choice((0, 0, 1, 1, 2, 5))))
        return f"{r.choice(functions)}({inner}{more})"
    if what == 7:
        return f"({inner})"
    if what == 8:
        return (r.choice(("-", "+", "--", "(", ")", "((", "")) * r.choice((1, 1, 70, 5000)) + inner)[:LONGEST]
    return (inner * r.choice((1, 1, 2, 300)))[:LONGEST]
