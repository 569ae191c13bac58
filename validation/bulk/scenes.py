"""The scenes of the silo and the drum, whole or small.

All that the published benchmark states is here (Dosta et al., Computer Physics Communications 296, 109066, 2024), but for
its initial states, which are files of its own. Here grains are packed loosely above, fall, and settle until `SETTLING`.
Then the lid under the orifice is taken away, or the drum begins to turn. All of it is one run, so that `carom resume`
continues it from any of its checkpoints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import carom
import numpy as np

GRAVITY = 9.81  # m/s^2
#: Densities of the two kinds of grains, kg/m^3.
DENSITY = {"M1": 2500.0, "M2": 2000.0}
#: Restitution and friction of pairs of materials. Walls never meet, so steel on steel is not needed.
LAWS = {
    ("M1", "M1"): (0.5, 0.3),
    ("M1", "M2"): (0.45, 0.2),
    ("M2", "M2"): (0.4, 0.4),
    ("M1", "steel"): (0.4, 0.2),
    ("M2", "steel"): (0.4, 0.2),
}
#: Time in which the bed comes to rest, s.
SETTLING = 0.25
#: Packing fractions that are filled at random: flat layers, and a bed. Jammed grains have 0.6, which takes long to pack.
LOOSE, DENSE = 0.45, 0.55
#: Time between two frames, s.
FRAME = 0.05
#: Share of the small version in the grains, and its lengths over those of the whole one.
PART = 1 / 20
SCALE = PART ** (1 / 3)
#: Radius of the small silo's orifice over that of the whole one. It is 8 and 5.3 grains wide, too wide for an arch.
WIDER = 8 / 15


def bare(title: str, kinds: tuple[str, ...], **run: Any) -> carom.Scene:
    """A world with the materials of these kinds of grains, without grains or walls."""
    scene = carom.Scene(title, gravity=(0.0, 0.0, -GRAVITY), run=run)
    # Contacts of 100 000 grains would be 50 MB a frame. Wall forces belong to no curve of the benchmark.
    scene.record.contacts = scene.record.impacts = scene.record.walls = False
    scene.record.every = round(FRAME / run["step"])
    scene.record.checkpoint_wall = 240.0
    for (a, b), (restitution, friction) in LAWS.items():
        if a in kinds and b in (*kinds, "steel"):
            scene.contact(a, b, restitution=restitution, friction=friction)
    return scene


@dataclass(frozen=True)
class Silo:
    """A tube on a cone that is open at its lip; lengths in m."""

    title: str
    grains: int
    lip: float
    """Height of the orifice."""
    orifice: float
    """Radius of the orifice."""
    cone: float
    """Height of the cone."""
    top: float
    """Height of the tube's upper end."""
    tube: float = 0.1
    """Radius of the tube."""
    diameter: float = 4e-3
    """Of a grain."""
    duration: float = 5.0
    """Time that is looked at once the orifice is open, s."""
    seed: int = 1
    """Of the bed."""

    def scene(self, **run: Any) -> carom.Scene:
        """Grains packed in the tube, and a lid under the orifice that is taken away at `SETTLING`."""
        scene = bare(self.title, ("M1",), until=SETTLING + self.duration, **run)
        neck = self.lip + self.cone
        volume = np.pi / 6 * self.diameter**3
        # Discs of three diameters fill the cone from below, so that little has to fall.
        discs = round(self.cone / (3 * self.diameter))
        height, left = self.cone / discs, self.grains
        for k in range(discs):
            radius = self.orifice + (self.tube - self.orifice) * k / discs
            count = int(LOOSE * np.pi * radius**2 * height / volume)
            left -= count
            self._fill(scene, f"cone{k + 1}.", count, radius, self.lip + k * height, height)
        self._fill(scene, "tube.", left, self.tube, neck, left * volume / (DENSE * np.pi * self.tube**2))
        scene.cone(
            "cone", material="steel", point=(0, 0, self.lip), axis=(0, 0, 1), radius=self.orifice,
            radius_end=self.tube, length=self.cone,
        )  # fmt: skip
        scene.cylinder(
            "tube", material="steel", point=(0, 0, (neck + self.top) / 2), axis=(0, 0, 1), radius=self.tube,
            length=self.top - neck,
        )  # fmt: skip
        scene.plane(
            "lid", material="steel", point=(0, 0, self.lip), normal=(0, 0, 1),
            radius=self.orifice + self.diameter / 2, motion={"until": SETTLING},
        )  # fmt: skip
        # Grains that have fallen five diameters below the orifice touch nothing any more, and cost no time.
        below = self.lip - 5 * self.diameter
        scene.outlet(low=(-1.0, -1.0, below - 1.0), high=(1.0, 1.0, below))
        return scene

    def _fill(
        self, scene: carom.Scene, name: str, count: int, radius: float, low: float, height: float
    ) -> None:
        """Grains at random in a part of the silo, from `low` up."""
        scene.packing(
            name, material="M1", density=DENSITY["M1"], seed=self.seed, count=count, diameter=self.diameter,
            region="cylinder", point=(0, 0, low + height / 2), axis=(0, 0, 1), region_radius=radius, length=height,
        )  # fmt: skip


@dataclass(frozen=True)
class Drum:
    """A closed drum about the axis y, with small grains M1 on top of large ones M2; lengths in m."""

    title: str
    small: int
    """Number of grains M1."""
    large: int
    """Number of grains M2."""
    radius: float = 0.1
    depth: float = 0.06
    rate: float = 2.0
    """rad/s; the wall moves upwards at +x."""
    diameters: tuple[float, float] = (2e-3, 4e-3)
    """Of M1 and M2."""
    duration: float = 5.0
    """Time that the drum turns, s."""
    seed: int = 1
    """Of the bed."""

    @property
    def grains(self) -> int:
        """All of them."""
        return self.small + self.large

    def scene(self, **run: Any) -> carom.Scene:
        """Two loose layers in a drum that stands until `SETTLING` and then turns."""
        scene = bare(self.title, ("M1", "M2"), until=SETTLING + self.duration, **run)
        end = SETTLING + self.duration
        turned = [[0.0, 0.0], [SETTLING, 0.0], [end, -self.rate * self.duration]]
        turn = {"rotation": {"axis": (0, 1, 0), "point": (0, 0, 0), "angle": {"table": turned}}}
        scene.cylinder(
            "drum", material="steel", point=(0, 0, 0), axis=(0, 1, 0), radius=self.radius, motion=turn
        )
        for name, side in (("front", -1), ("back", 1)):
            scene.plane(
                name, material="steel", point=(0, side * self.depth / 2, 0), normal=(0, -side, 0), motion=turn
            )
        # Both layers are boxes, since a packing fills no segment of a circle; their corners lie in the drum.
        low, half = -0.6 * self.radius, 0.8 * self.radius
        counts = (("M2", self.large, self.diameters[1]), ("M1", self.small, self.diameters[0]))
        for name, count, diameter in counts:
            high = low + count * np.pi / 6 * diameter**3 / (LOOSE * 2 * half * self.depth)
            scene.packing(
                name, material=name, density=DENSITY[name], seed=self.seed, count=count, diameter=diameter,
                low=(-half, -self.depth / 2, low), high=(half, self.depth / 2, high),
            )  # fmt: skip
            low = high
        return scene


Case = Silo | Drum

#: The cases as the benchmark has them.
WHOLE: dict[str, Case] = {
    "silo-large": Silo("Silo, large orifice", 100_000, lip=-0.0554222, orifice=0.03, cone=0.07, top=0.3146),
    "silo-small": Silo("Silo, small orifice", 100_000, lip=-0.0593008, orifice=0.02, cone=0.08, top=0.3207),
    "drum": Drum("Drum", 30_000, 8_000),
}


def smaller(case: Case) -> Case:
    """A twentieth of the grains, of the same size, in walls whose lengths are smaller in proportion.

    Only the orifice is wider than that. The drum turns faster, so that centrifugal force over weight is the same.
    """
    if isinstance(case, Drum):
        return Drum(
            f"{case.title}, small", round(case.small * PART), round(case.large * PART), case.radius * SCALE,
            case.depth * SCALE, case.rate / SCALE**0.5, duration=round(case.duration * SCALE**0.5, 1),
        )  # fmt: skip
    orifice, tube = case.orifice * WIDER, case.tube * SCALE
    cone = case.cone * (tube - orifice) / (case.tube - case.orifice)  # at the same angle
    return Silo(
        f"{case.title}, small", round(case.grains * PART), case.lip * SCALE, orifice, cone, case.top * SCALE, tube,
        duration=0.5,
    )  # fmt: skip


SMALL: dict[str, Case] = {name: smaller(case) for name, case in WHOLE.items()}
