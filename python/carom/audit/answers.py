"""What joints, dampers and drag answer to impulses of contacts, at once and in every impact problem (algorithm, section 7):

    (M + w C) dV = P + G^T Lambda,    G dV = 0,    w = h (Moreau-Jean: theta h)

with the gradients `G` of joints where the velocity level has the bodies, and `C = -df/dv` of dampers and drag there. `dV` is
linear in `P`, and one, also where rows of joints repeat one another; only rows that nearly do leave it unsure. A clump moves
as one body, which its first ball stands for (`Run.node`), at the places of the second frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import forces, free_turns, gradients, hits
from carom.audit.block import Block, Rows, once
from carom.audit.corrections import swing
from carom.audit.data import Run
from carom.audit.gradients import Places
from carom.audit.loads import of_loads
from carom.audit.reactions import LARGEST
from carom.audit.report import Tally
from carom.audit.vectors import add_at, cross, exponential, product, rotated
from carom.audit.wrenches import groups as joined
from carom.audit.wrenches import pulled_from, remembered

#: How much a contact gives way with its joints, over what it does without, below which they hold nearly the same motion.
REPEATED = 1e-3


class Group(NamedTuple):
    """Nodes that answer together in A intervals of a block."""

    bodies: I64
    slot: I64
    """(B,) the number of an interval among the A, -1 where the group had no contact in one whole step."""
    answer: gradients.Answer


class Answers:
    """Velocities that impulses give the bodies of a block."""

    def __init__(self, block: Block) -> None:
        run, n = block.run, block.run.bodies
        self.block = block
        self.inertia = np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1)
        self.groups: list[Group] = []
        #: (N,) the group of each body, of balls of clumps that of the clump; -1 for those that nothing holds.
        self.group_of = np.full(n, -1)
        #: (B, N) whose answer is not sure.
        self.unsure = np.zeros((block.count, n), dtype=bool)
        met = _met(block)
        for bodies in _answering(run):
            active = np.flatnonzero(met[:, bodies].any(axis=1) & block.single)
            if not len(active):
                continue
            self.group_of[np.isin(run.node, bodies)] = len(self.groups)
            slot = np.full(block.count, -1)
            slot[active] = np.arange(len(active))
            answer = _answers(block, bodies, active)
            self.groups.append(Group(bodies, slot, answer))
            unsure = answer.unsure.copy()
            unsure[_repeated(block, self.groups[-1])] = True
            self.unsure[np.ix_(active[unsure], np.flatnonzero(np.isin(run.node, bodies)))] = True

    def of(self, at: I64, momenta: F64, *, free: bool = False) -> tuple[I64, F64]:
        """The bodies that momenta (M, 6) move, and their velocities. They are given at `at`: interval times N plus body,
        each once; `free`, where joints and loads answer nothing.
        """
        n, run = len(self.inertia), self.block.run
        k, body = np.divmod(at, n)
        alone, clumped = (self.group_of[body] < 0) | free, run.clump_of[body] >= 0
        where, found = (
            [at[alone & ~clumped]],
            [momenta[alone & ~clumped] / self.inertia[body[alone & ~clumped]]],
        )
        mine = np.flatnonzero(alone & clumped)
        if mine.size:
            whole, moved = self._of_clumps(k[mine], body[mine], momenta[mine])
            where.append(whole)
            found.append(moved)
        for number, group in enumerate([] if free else self.groups):
            mine = np.flatnonzero(self.group_of[body] == number)
            if not mine.size:
                continue
            which, row = np.unique(k[mine], return_inverse=True)
            given = np.zeros((len(which), len(group.bodies), 6))
            at_nodes = np.searchsorted(group.bodies, run.node[body[mine]])
            add_at(given, (row, at_nodes), self._about_nodes(k[mine], body[mine], momenta[mine]))
            moved = group.answer.of(given, group.slot[which])
            for node, motion in zip(group.bodies.tolist(), moved.swapaxes(0, 1), strict=True):
                balls = np.flatnonzero(run.node == node) if run.in_clump[node] else np.array([node])
                where.append((which[:, None] * n + balls).ravel())
                found.append(self._of_balls(which, balls, motion).reshape(-1, 6))
        return np.concatenate(where), np.concatenate(found)

    def _arms(self, k: I64, body: I64) -> F64:
        """(M, 3) centres of bodies from those of their nodes in the intervals `k`, m."""
        run = self.block.run
        found = np.zeros((len(k), 3))
        mine = np.flatnonzero(run.clump_of[body] >= 0)
        q = self.block.c1[k[mine], run.clump_of[body[mine]], 3:7]
        found[mine] = rotated(q, run.clumps.offsets[body[mine]])
        return found

    def _about_nodes(self, k: I64, body: I64, momenta: F64) -> F64:
        """(M, 6) momenta of bodies as those of their nodes."""
        turning = momenta[:, 3:] + cross(self._arms(k, body), momenta[:, :3])
        return np.hstack([momenta[:, :3], turning])

    def _of_balls(self, which: I64, balls: I64, motion: F64) -> F64:
        """(A, n, 6) the velocities of the balls of a node, of that of the node (A, 6) in the intervals `which`."""
        many = len(balls)
        arm = self._arms(np.repeat(which, many), np.tile(balls, len(which))).reshape(len(which), many, 3)
        spin = np.repeat(motion[:, None, 3:], many, axis=1)
        return np.concatenate([motion[:, None, :3] + cross(spin, arm), spin], axis=-1)

    def _of_clumps(self, k: I64, body: I64, momenta: F64) -> tuple[I64, F64]:
        """The same of momenta (M, 6) that are given to balls of clumps: it moves all balls of these."""
        run, all_of = self.block.run, self.block.run.clumps
        many = len(all_of)
        keys, row = np.unique(k * many + run.clump_of[body], return_inverse=True)
        which, number = np.divmod(keys, many)
        q = self.block.c1[which, number, 3:7]
        given = np.zeros((len(keys), 6))
        arm = rotated(q[row], all_of.offsets[body])
        add_at(given, (row,), np.hstack([momenta[:, :3], momenta[:, 3:] + cross(arm, momenta[:, :3])]))
        along, spin = given[:, :3] / all_of.mass[number, None], all_of.turning(q, given[:, 3:], number)
        each, balls = all_of.balls_of(number)
        lever = rotated(q[each], all_of.offsets[balls])
        moved = np.hstack([along[each] + cross(spin[each], lever), spin[each]])
        return which[each] * run.bodies + balls, moved


@once
def of_block(block: Block) -> Answers:
    """Of the whole steps of a block."""
    return Answers(block)


def unheld(block: Block, off: F64, bound: F64, held: F64) -> tuple[F64, F64]:
    """Ways (B, N, 6) that nodes are off, without those that joints give along their directions, and how far they may be:
    `bound` and `held` (B, N, 2), beside joints and by them.

    In one step of nsga that is `off` less its part in the span of `M^-1 G^T`, in the norm of the masses, in which a group
    may be off by the root of the sum of all squares. Directions turn by at most `4 h rate` from those of the steps before.
    """
    run, off, alone, held = block.run, off.copy(), bound, np.minimum(held, LARGEST)
    bound = bound + held
    single = np.flatnonzero(block.single)
    if run.method != "nsga" or not len(single):
        return off, bound
    for names, joints in joined(run):
        bodies = np.array(names, dtype=np.int64)
        mine, places = np.ix_(single, bodies), (block.x1[single], block.q1[single])
        answer = gradients.answer(run, bodies, places, answering=False)
        inert = np.stack([run.heavy[bodies], run.node_inertia[bodies]], axis=1)
        most = np.stack([run.heavy[bodies], gradients.largest(run)[bodies]], axis=1)
        off[mine] = answer.of(np.einsum("anij,anj->ani", gradients.inert(run, bodies, places), off[mine]))
        # Also by what contacts move the bodies at the position level.
        pushed = forces.of_contacts(block).shift_size[:, bodies] / np.sqrt(run.mass[bodies])
        fast = pushed.max(axis=1) / run.h if run.has_contacts else 0.0
        rate = np.max([swing(block, joint, end, fast)[1] for joint in joints for end in (0, 1)], axis=0)
        turned = np.where(block.single, np.minimum(1.0, 4.0 * run.h * rate), 1.0)[:, None, None]
        # What was before a block may have had any direction.
        earlier = held[:1, bodies] * (block.first > 1)
        kept = remembered(run, np.concatenate([earlier, held[:, bodies]]))[1:]
        across = remembered(run, np.concatenate([earlier, turned * kept]))[1:]
        size = (most * (alone[mine] + across[single]) ** 2).sum(axis=(1, 2), keepdims=True)
        bound[mine] = np.sqrt(size / inert)
    return off, bound


def before_contacts(block: Block, reading: int = 0) -> F64:
    """(B, N, 6) velocities that the loads have left where contacts begin to act, of groups without impacts, by a reading of
    the moments (`forces`): those of the frame less what the recorded impulses gave.
    """
    sums = forces.of_contacts(block)
    moved = given(block, np.concatenate([sums.impulse, sums.moments[reading]], axis=-1))
    return np.concatenate([block.v1, block.w1], axis=-1) - moved


def given(block: Block, momenta: F64) -> F64:
    """(B, N, 6) velocities that momenta (B, N, 6) give in the whole steps of a block; none in other intervals."""
    flat, found = momenta.reshape(-1, 6), np.zeros((momenta.size // 6, 6))
    at = np.flatnonzero((flat != 0.0).any(axis=1) & np.repeat(block.single, block.run.bodies))
    where, moved = of_block(block).of(at, flat[at])
    add_at(found, (where,), moved)
    return found.reshape(momenta.shape)


def sure(block: Block, tally: Tally, kind: str, chosen: Bool, c: Rows | hits.Hits) -> Bool:
    """(K,) those of the `chosen` rows whose answers are one; the others are not judged."""
    doubt = of_block(block).unsure[c.k, c.a] & chosen
    doubt |= (
        (c.b < block.run.bodies) & of_block(block).unsure[c.k, np.minimum(c.b, block.run.bodies - 1)] & chosen
    )
    if doubt.any():
        first = block.run.names[int(c.a[np.argmax(doubt)])]
        why = f"joints of {first} nearly repeat one another, or a contact: no one can tell what they answer to an impulse"
        tally.skip(kind, why, "leave out what repeats", int(doubt.sum()))
    return np.asarray(chosen & ~doubt)


def _repeated(block: Block, group: Group) -> I64:
    """Slots in which joints hold nearly what a contact between their bodies does: its impulses may then be of any size."""
    run, c, bodies = block.run, block.rows, group.bodies
    other = np.minimum(c.b, run.bodies - 1)
    within = np.isin(run.node[c.a], bodies) & np.isin(run.node[other], bodies) & (c.b < run.bodies)
    mine = np.flatnonzero(within & (group.slot[c.k] >= 0))
    parts = np.zeros((len(mine), len(bodies), 6))
    each = np.arange(len(mine))
    places = block.x1[c.k[mine]], block.q1[c.k[mine]]
    alone = np.zeros(len(mine))
    for body, sign in ((c.a[mine], 1.0), (c.b[mine], -1.0)):
        at = np.searchsorted(bodies, run.node[body])
        parts[each, at, :3] = sign * c.normal[mine]
        parts[each, at, 3:] = sign * cross(gradients.from_nodes(run, body, places[1]), c.normal[mine])
        alone += free_turns.inverse_mass(block, c.k[mine], body, c.normal[mine])
    if not len(mine):
        return mine
    gives = (parts * gradients.answer(run, bodies, places, answering=False).of(parts)).sum(axis=(1, 2))
    return np.unique(group.slot[c.k[mine]][gives < REPEATED * alone])


def _met(block: Block) -> Bool:
    """(B, N) bodies with a contact or impact on record, all balls of a clump with one."""
    run = block.run
    found = np.zeros((block.count, run.bodies), dtype=bool)
    for table in ([block.rows] if run.has_contacts else []) + (
        [hits.of_block(block)] if run.has_impacts else []
    ):
        found[table.k, table.a] = True
        ball = table.b < run.bodies
        found[table.k[ball], table.b[ball]] = True
    run.clumps.share(np.logical_or, found)
    return found


def _answering(run: Run) -> Iterator[I64]:
    """The bodies of each group."""
    held = {int(one[side]) for one in (*run.joints, *gradients.dampers(run)) for side in "ab"} - {-1}
    held |= {int(load["body"]) for load in gradients.drags(run)}
    bodies = np.unique(run.node[sorted(held)])
    for number in np.unique(run.linked[bodies]):
        yield bodies[run.linked[bodies] == number]


def _answers(block: Block, bodies: I64, active: I64) -> gradients.Answer:
    """The answers of a group in some intervals."""
    run = block.run
    ends: list[Places] = [(x[active], q[active]) for x, q in ((block.x0, block.q0), (block.x1, block.q1))]
    if run.method != "moreau":
        return gradients.answer(run, bodies, ends[1])
    # Moreau-Jean asks where the smooth motion ends. Its velocities are those of the loads, held by the joints there: those
    # of the frame less what contacts gave, on record or as what no load gave (joints give nothing along their answer).
    sums = forces.of_contacts(block) if run.has_contacts else None
    given, theta = of_loads(block), float(run.options["theta"])
    old, new = (
        np.concatenate(of, axis=-1)[active][:, bodies] for of in ((block.v0, block.w0), (block.v1, block.w1))
    )
    inert = np.repeat(np.stack([run.mass[bodies], run.inertia[bodies]], axis=1), 3, axis=1)
    pushed = given.alone[active][:, bodies] / inert
    pushed[..., :3] += run.h * (run.falls[bodies] if run.free_walls else run.falls)
    smooth = old + pushed
    for _ in range(6):
        mean = run.h * ((1.0 - theta) * old + theta * smooth)
        x, q = ends[0][0].copy(), ends[0][1].copy()
        x[:, bodies] += mean[..., :3] + given.shift[active][:, bodies, :3]
        q[:, bodies] = product(exponential(mean[..., 3:]), q[:, bodies])
        found = gradients.answer(run, bodies, (x, q))
        if sums is not None:  # also where a function of the user acts, which is on no record
            apart = np.concatenate([sums.impulse, sums.moments[0]], axis=-1)[active][:, bodies]
        else:  # springs are taken there too, not at the places of the frame
            there = theta * run.h * pulled_from(block, active, (x, q))[:, bodies] / inert
            apart = inert * (new - old - pushed - there)
        smooth = new - found.of(apart)
    return found
