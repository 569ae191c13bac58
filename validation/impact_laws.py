"""Impact laws side by side, and experiments beside them: the page docs/validation/impact_laws.md.

python validation/impact_laws.py             # prints the page
python validation/impact_laws.py --write     # writes it, and its figure
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import carom
import numpy as np
from carom.scene.chains import chain, column
from carom.scene.scene import Scene
from carom.scene.tables.impact_laws import LAWS

PAGE = Path(__file__).parent.parent / "docs" / "validation" / "impact_laws.md"

HERTZ = {
    3: (-0.0710, 0.0764, 0.9945),
    4: (-0.0711, -0.0296, 0.1097, 0.9910),
    10: (-0.07108, -0.03027, -0.01583, -0.00889, -0.00513, -0.00299, -0.00174, 0.00267, 0.14739, 0.98587),
}
"""Velocities over that of the first ball, e = 1, equal steel balls that touch: the Hertz chain, integrated elsewhere."""

ANGLES = (1.8, 3.7, 9.5, 20.0, 30.1, 39.4, 49.7, 60.0)
RATIOS = (0.793, 0.745, 0.673, 0.597, 0.688, 0.771, 0.848, 0.901)
SPIN_ANGLES = (6.1, 11.0, 21.3, 31.2, 39.1, 50.3, 60.3)
SPINS = (136, 266, 578, 613, 595, 453, 382)
"""Kharaz, Gorham and Salman, Powder Technol. 120 (2001) 281: angle from the normal (degrees), v_t'/v_t, and spin (rad/s)."""


def velocities(scene: Scene, law: str, axis: int) -> np.ndarray:
    """Of all balls at the end, (N,)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        return np.asarray(carom.simulate(scene, impact=law).velocity[-1])[:, axis]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [list(head), ["---"] * len(head), *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def side_by_side(scene: Scene, axis: int, beside: Sequence[float] | None = None) -> str:
    """A row for each law: velocities of the balls, m/s, and the share of the energy that is left."""
    count = len(scene.names)
    masses = np.array(
        [s.mass if s.mass is not None else s.density * s.radius**3 for s in scene.spheres], dtype=float
    )
    before = np.array([s.velocity[axis] for s in scene.spheres], dtype=float)
    rows = []
    for law in LAWS:
        v = velocities(scene, law, axis)
        energy = float(masses @ v**2 / (masses @ before**2))
        # Rounded first: what is no more than rounding below 0 has no sign.
        rows.append([f"`{law}`", *(f"{x:.4f}" for x in v.round(4) + 0.0), f"{energy:.4f}"])
    if beside is not None:
        rows.append(["Hertz chain", *(f"{x:.4f}" for x in beside), ""])
    return table(["law", *map(str, range(1, count + 1)), "energy left"], rows)


def oblique(angle: float, e_t: float) -> tuple[float, float]:
    """v_t'/v_t, and the spin (rad/s), of an alumina ball of 5 mm on glass at 3.9 m/s, `angle` degrees from the normal."""
    scene = Scene(gravity=(0, 0, 0))
    scene.contact("ball", "ball", friction=0.092, restitution=0.98, tangential_restitution=e_t)
    scene.plane("glass", material="ball", point=(0, 0, 0), normal=(0, 0, 1))
    v = 3.9 * math.sin(math.radians(angle)), 3.9 * math.cos(math.radians(angle))
    scene.sphere(
        "b",
        radius=2.5e-3,
        material="ball",
        density=3850.0,
        position=(0, 0, 2.5e-3),
        velocity=(v[0], 0, -v[1]),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        end = carom.simulate(scene, step=1e-6, until=1e-6)
    return float(end.velocity[-1][0, 0]) / v[0], abs(float(end.angular_velocity[-1][0, 1]))


def parts() -> Iterator[str]:
    """The page, part by part."""
    yield (
        "# Impact laws side by side\n\n"
        "Which ball goes where when several touch? Rigid bodies leave it open, and each law answers in its\nown way. "
        "[The laws](../guides/choose.md#which-impact-law) are listed with advice when to take them.\n\n"
        "    carom compare SCENE --laws all --plot figure.svg     # a scene of your own\n"
        "    python validation/impact_laws.py --write             # this page\n\n"
        '```python\nimport carom\n\nprint(carom.compare(carom.chains.chain(3), laws="all"))\n```\n\n'
        'Velocities are in m/s. "Energy left" is the kinetic energy over that before.\n'
    )
    yield "\n## Equal balls in a row\n\nThe first ball has 1 m/s, e = 1. The last line is the Hertz chain.\n"
    for count, hertz in HERTZ.items():
        yield f"\n{count} balls that touch:\n\n{side_by_side(chain(count), 0, hertz)}"
    yield (
        "\nThe sequence sends one ball away, as a row with gaps does. `one-shot` and `poisson` spread the\n"
        "impulse over all balls. Stiff contacts do neither: the last ball takes nearly all, and the first\n"
        "ones go back. `compliant` is that limit.\n"
    )
    yield "\n![Ten balls by each law: velocities after, and how the impulses grow](impact_laws.svg)\n"
    yield f"\nFive balls, e = 0.9:\n\n{side_by_side(chain(5, restitution=0.9), 0)}"
    yield "\n## Other rows\n\n"
    yield f"Tapered: each radius is 0.8 times the one before.\n\n{side_by_side(chain(5, taper=0.8), 0)}"
    yield f"\nDecorated: every second ball has a third of the radius.\n\n{side_by_side(chain(5, between=0.01 / 3), 0)}"
    yield (
        "\n## A column on a floor\n\n"
        "A ball hits three others that stand on a floor, from above, with 1 m/s. Ball 1 is on the floor,\n"
        "e = 0.8.\n\n"
        f"{side_by_side(column(4, restitution=0.8, gravity=0.0), 2)}"
    )
    yield (
        "\n## An oblique impact, measured\n\n"
        "Kharaz, Gorham and Salman (Powder Technol. 120, 2001, 281) shot alumina balls of 5 mm at glass with\n"
        "3.9 m/s, e = 0.98, friction 0.092. A rigid ball has one number besides, `tangential_restitution`.\n"
        "Here it is 0.44, by `sequence`.\n\n"
    )
    rows = []
    for angle, measured in zip(ANGLES, RATIOS, strict=True):
        found = oblique(angle, 0.44)[0]
        rows.append(
            [f"{angle:g}", f"{measured:.3f}", f"{found:.3f}", f"{100 * (found / measured - 1):+.0f} %"]
        )
    yield "Tangential velocity after over before:\n\n"
    yield table(["angle from the normal (degrees)", "measured", "Carom", "off"], rows)
    rows = []
    for angle, spin in zip(SPIN_ANGLES, SPINS, strict=True):
        found = oblique(angle, 0.44)[1]
        rows.append([f"{angle:g}", f"{spin}", f"{found:.0f}", f"{100 * (found / spin - 1):+.0f} %"])
    yield "\nSpin after, rad/s:\n\n"
    yield table(["angle from the normal (degrees)", "measured", "Carom", "off"], rows)
    yield (
        "\nThe law misses the small angles. Below 10 degrees the ball keeps more of its tangential velocity\n"
        "than any constant tangential restitution gives.\n"
    )


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--write", action="store_true", help="Write the page and its figure.")
    page = "".join(parts())
    if not parser.parse_args().write:
        print(page)
        return
    PAGE.write_text(page, "utf-8")
    from carom.show.plot.comparison import beside
    from carom.show.plot.style import save

    chart = beside(carom.compare(chain(10), laws="all"))
    # The points of the curves would be half a megabyte.
    chart.data = {name: x[:10] for name, x in chart.data.items() if name.endswith("(m/s)")}
    save(chart, PAGE.parent, PAGE.stem, ["svg"])


if __name__ == "__main__":
    main()
