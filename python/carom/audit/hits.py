"""Rows of the table of impacts, the contacts of the frames that they belong to, and the impulses that remained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool, connected
from carom.audit.block import Block
from carom.audit.report import Place
from carom.audit.vectors import EPS, add_at, norm


@dataclass(frozen=True)
class Hits:
    """Rows of the table of impacts in a block."""

    k: I64
    step: I64
    problem: I64
    a: I64
    b: I64
    status: I64
    normal: F64
    impulse: F64
    moment: F64
    approach: F64
    separation: F64
    scale: F64

    def __len__(self) -> int:
        return len(self.k)

    def of(self, chosen: Bool | I64 | slice) -> Hits:
        """Some of them."""
        return Hits(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})

    def contacts(self, block: Block) -> tuple[I64, Bool]:
        """The row of `Block.rows` of each, and whether there is one."""
        c, many = block.rows, len(block.run.names)
        keys, own = (c.k * many + c.a) * many + c.b, (self.k * many + self.a) * many + self.b
        if not len(keys):
            return np.zeros(len(self), dtype=np.int64), np.zeros(len(self), dtype=bool)
        order = np.argsort(keys, kind="stable")
        contact = order[np.minimum(np.searchsorted(keys[order], own), len(keys) - 1)]
        return contact, keys[contact] == own


def of_block(block: Block) -> Hits:
    """The rows of the steps of a block."""
    table = block.run.result.impacts
    step = block.run.impact_step
    low, high = np.searchsorted(step, [block.s0[0] + 1, block.s1[-1] + 1])

    def column(name: str) -> F64:
        return np.asarray(table[name][low:high])

    body = block.run.pairs(table, int(low), int(high))
    k = np.searchsorted(block.s1, step[low:high])
    numbers = (
        column(n) for n in ("normal", "impulse", "moment", "approach", "separation", "restitution_scale")
    )
    problem, status = (column(n).astype(np.int64) for n in ("problem", "status"))
    return Hits(k, step[low:high], problem, body[:, 0], body[:, 1], status, *numbers)


def kept(block: Block, r: Hits) -> tuple[Bool, F64, F64]:
    """Which impulses of problem 0 remained: an impact takes those of its contacts back and solves them anew. Told by the
    contact's whole impulse of the step, which must be the sum with or without it; with the misfit of that sum, impulse
    and moment over the radius, and the rounding of it, N s.
    """
    run, c = block.run, block.rows
    contact, known = r.contacts(block)
    many = len(run.names)
    _, group = np.unique((r.k * many + r.a) * many + r.b, return_inverse=True)
    over = 1.0 / run.radius[r.a][:, None]
    own = np.hstack([r.impulse, r.moment * over])
    whole = np.zeros((len(r), 6))
    mine = contact[known]
    whole[known] = np.hstack([c.impulse[mine], c.moment[mine] * over[known]])
    sums, loads = np.zeros((len(r), 6)), np.zeros((len(r), 6))
    add_at(sums, (group,), np.where((r.problem > 0)[:, None], own, 0.0))
    add_at(loads, (group,), np.where((r.problem == 0)[:, None], own, 0.0))
    sums, loads = sums[group], loads[group]
    without, within = norm(whole - sums), norm(whole - sums - loads)
    bound = 32.0 * EPS * (norm(whole) + np.bincount(group, norm(own))[group])
    # Sweeps add to the impulses of all neighbours, and take back again.
    largest = np.zeros(block.count)
    np.maximum.at(largest, r.k, norm(own))
    bound = bound + np.where(block.cascaded[r.k], 32.0 * EPS * largest[r.k], 0.0)
    return np.asarray(within <= without), np.minimum(without, within), np.maximum(bound, 1e-300)


def place(block: Block, r: Hits) -> Callable[[int], Place]:
    """The place of a row by its number."""
    return lambda i: block.run.step_place(int(r.step[i]), int(r.a[i]), int(r.b[i]))


def groups(block: Block, r: Hits) -> I64:
    """(K,) a number of each group of rows of a step that balls, joints or dampers join: others cannot have changed their
    speeds.
    """
    run = block.run
    ball = np.minimum(r.b, run.bodies - 1)
    first = r.k * run.bodies + run.linked[r.a]
    second = np.where(r.b < run.bodies, r.k * run.bodies + run.linked[ball], first)
    nodes, where = np.unique(np.concatenate([first, second]), return_inverse=True)
    a, b = np.split(where, 2)
    return np.asarray(np.unique(connected(len(nodes), a, b)[a], return_inverse=True)[1])


def pairs(block: Block, r: Hits, group: I64) -> F64:
    """(K,) how many pairs of bodies the group of each row has."""
    many = len(block.run.names)
    _, pair, count = np.unique((r.k * many + r.a) * many + r.b, return_inverse=True, return_counts=True)
    return np.asarray(np.rint(np.bincount(group, 1.0 / count[pair]))[group])


def after_cut(block: Block, r: Hits) -> tuple[Bool, Bool]:
    """(K,) rows that go on by Newton's law after an impact through springs that was cut, and which of them may instead be of
    one that was not: steps count what was cut, and beside it another island may have had a problem 2 of its own.
    """
    run, none = block.run, np.zeros(len(r), dtype=bool)
    if run.impact_law.restitution != "energetic":
        return none, none
    cut = (r.problem > 1) & (run.steps["truncated"][r.step - 1] > 0)
    joined = groups(block, r)
    last = np.zeros(joined.max(initial=-1) + 1, dtype=np.int64)
    np.maximum.at(last, joined, r.problem)
    return cut, cut & (last[joined] == 2)
