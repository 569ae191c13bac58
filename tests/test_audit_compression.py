"""The auditor's impulses of compression: of several solutions the least."""

from __future__ import annotations

import numpy as np
from carom.arrays import F64
from carom.audit import compression


def rows(normal: F64) -> F64:
    """(3, 6) gradients of a ball of radius 1 m where it touches a wall, by its velocity and angular velocity."""
    across = np.cross(normal, (0.0, 0.0, 1.0))
    ways = np.array([normal, across, np.cross(normal, across)])
    turned = np.cross(-normal, ways)
    turned[0] = 0.0
    return np.hstack([ways, turned])


def solves(w: F64, q: F64, mu: F64, impulses: F64) -> bool:
    """Whether impulses (2, 3) obey the law: nothing closes, and friction is in its bound, against what slips at it."""
    z = (w @ impulses.ravel() + q).reshape(2, 3)
    push, size = impulses[:, 0], np.linalg.norm(impulses[:, 1:], axis=1)
    slips = np.linalg.norm(z[:, 1:], axis=1)
    against = np.abs(slips * size + np.sum(z[:, 1:] * impulses[:, 1:], axis=1))
    room = mu * push - size
    small = 1e-10  # the softness, squared, and rounding
    return bool(
        (push > -small).all()
        and (z[:, 0] > -small).all()
        and (np.minimum(push, z[:, 0]) < small).all()
        and (room > -small).all()
        and (against < small).all()
        and (np.minimum(room, slips) < small).all()
    )


def test_of_a_ball_that_a_corner_holds_by_friction_they_are_the_least() -> None:
    """Both walls may press harder along the line between their contacts: of all solutions on it the one that contacts have
    which give way alike.
    """
    gradient = np.vstack([rows(np.array(normal)) for normal in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))])
    w = (gradient * np.array([1.0, 1.0, 1.0, 2.5, 2.5, 2.5])) @ gradient.T
    line = np.linalg.svd(w)[2][-1].reshape(2, 3)
    assert np.abs(w @ line.ravel()).max() < 1e-14
    rng, known, several = np.random.default_rng(0), 0, 0

    def size(impulses: F64) -> float:
        return float(np.sum(np.diag(w) * impulses.ravel() ** 2))

    for number in range(300):
        velocity = rng.normal(size=6)
        velocity[:2] = -np.abs(velocity[:2])
        if number % 3 == 0:
            # Into one wall, along the other.
            velocity[number % 2] = 0.0
        if number % 5 == 0:
            velocity[2:] = 0.0
        mu, q = np.full(2, rng.choice([0.3, 0.9, 1.2])), gradient @ velocity
        found = compression.solve(w, q, mu, np.zeros((2, 3)))
        if found is None:
            continue
        known += 1
        assert solves(w, q, mu, found[0])
        others = [found[0] + share * line for share in (-1e-3, -1e-5, 1e-5, 1e-3)]
        others = [other for other in others if solves(w, q, mu, other)]
        several += bool(others)
        assert all(size(other) > size(found[0]) for other in others)
    assert known > 200
    assert several > 30
