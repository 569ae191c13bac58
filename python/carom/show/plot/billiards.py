"""A table of the billiards kit and its balls seen from above, for `trajectories`; outlines and colours are those of
`carom.billiards`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64
from carom.scene.billiards.look import COLOURS, IVORY, BallLook
from carom.scene.billiards.shape import Hole, Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch


INK = "#17181b"
#: Of parts of the table, in the order in which they are drawn: the `gid` of an artist, by which it is found again.
ORDER = ("wood", "cloth", "line", "shade", "cushion", "hole", "liner", "sight")


def draw_table(axes: Axes, shape: Shape) -> None:
    """Rails, cloth, cushions, pockets and diamonds, below all that is drawn of a run."""
    from matplotlib.patches import Circle, Polygon, Wedge

    cloth, wood = COLOURS["cloth"][0], COLOURS["wood"][0]

    def put(kind: str, patch: Patch, face: Any, edge: Any = "none", **look: Any) -> None:
        patch.set(facecolor=face, edgecolor=edge, gid=kind, zorder=0.1 + 0.05 * ORDER.index(kind), **look)
        axes.add_patch(patch)

    put("wood", Polygon(shape.frame(shape.rail, shape.corner)), mixed(wood, "#000000", 0.35))
    bevel = 0.25 * shape.size
    put("wood", Polygon(shape.frame(shape.rail - bevel, shape.corner - bevel)), mixed(wood, "#ffffff", 0.06))
    put("cloth", Polygon(_rectangle(shape, shape.cushion)), cloth)
    for line in shape.lines:
        put("line", Polygon(line), COLOURS["line"][0], COLOURS["line"][0], linewidth=0.4)
    # The shadow under the noses, darker towards them.
    for k in range(1, 7):
        put("shade", _ring(shape, 0.0, -0.22 * k * shape.size), "#000000", alpha=0.055)
    for cushion in shape.cushions:
        outline = shape.rubber(cushion)
        put(
            "cushion",
            Polygon(outline),
            mixed(cloth, "#000000", 0.16),
            mixed(cloth, "#000000", 0.45),
            linewidth=0.4,
        )
        nose = np.array([cushion.start, cushion.start + cushion.length * cushion.way])
        axes.plot(*nose.T, color=mixed(cloth, "#ffffff", 0.25), linewidth=0.7, zorder=0.36, gid="nose")
    for hole in shape.holes:
        # Deeper is darker, and seen smaller.
        for share, dark in ((1.0, 0.45), (0.93, 0.65), (0.86, 0.82), (0.8, 0.94)):
            put(
                "hole",
                Circle(_pair(hole.centre), share * hole.radius),
                mixed(COLOURS["liner"][0], "#000000", dark),
            )
        start, end = _open(hole)
        ring = Wedge(_pair(hole.centre), hole.radius + shape.liner, start, end, width=shape.liner)
        put("liner", ring, COLOURS["liner"][0], "#000000", linewidth=0.3)
    for sight in shape.sights:
        put("sight", Polygon(sight), COLOURS["sight"][0])
    low, high = shape.box
    margin = 0.4 * shape.size
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def draw_path(axes: Axes, path: F64, look: BallLook) -> None:
    """The way of a ball, (T, 2): in its colour, of a stripe dashed over ivory."""
    from matplotlib.patheffects import Normal, Stroke

    light = look.kind == "cue"
    edge = mixed(COLOURS["cloth"][0], "#000000", 0.45) if light else mixed(look.colour, "#ffffff", 0.75)
    rim = [Stroke(linewidth=1.9, foreground=edge, alpha=0.5 if light else 0.55), Normal()]
    ground = IVORY if look.kind == "stripe" else look.colour
    axes.plot(*path.T, color=ground, linewidth=1.1, zorder=3, path_effects=rim, label=look.label or look.kind)
    if look.kind == "stripe":
        axes.plot(*path.T, color=look.colour, linewidth=1.1, linestyle=(0, (3, 2)), zorder=3)


def draw_ghost(axes: Axes, at: F64, radius: float, look: BallLook) -> None:
    """Where a ball was at the start, (2,)."""
    from matplotlib.patches import Circle

    found = Circle(
        _pair(at), radius, facecolor=(*_rgb(look.colour), 0.3), edgecolor=(1, 1, 1, 0.75), linewidth=0.5
    )
    found.set(zorder=2, gid="start")
    axes.add_patch(found)


def draw_ball(
    axes: Axes, at: F64, radius: float, look: BallLook, *, zorder: float, alpha: float = 1.0
) -> None:
    """A ball with its number, its stripe or its dots upwards, (2,)."""
    from matplotlib.patches import Circle, Ellipse, PathPatch, Rectangle
    from matplotlib.textpath import TextPath
    from matplotlib.transforms import Affine2D

    x, y = _pair(at)
    striped = look.kind == "stripe"

    def put(
        patch: Patch, colour: Any, *, clip: Patch | None = None, gid: str | None = None, opacity: float = 1.0
    ) -> Any:
        patch.set(facecolor=colour, edgecolor="none", zorder=zorder, gid=gid, alpha=alpha * opacity)
        axes.add_patch(patch)
        if clip is not None:
            patch.set_clip_path(clip)
        return patch

    put(Circle((x + 0.16 * radius, y - 0.2 * radius), 1.06 * radius), "#000000", opacity=0.35)
    body = put(Circle((x, y), radius), IVORY if striped else look.colour, gid=f"ball {look.kind}")
    if striped:
        put(
            Rectangle((x - radius, y - 0.58 * radius), 2 * radius, 1.16 * radius),
            look.colour,
            clip=body,
            gid="stripe",
        )
    if look.label:
        put(Circle((x, y), 0.56 * radius), IVORY, gid="disc")
        size = radius * {1: 0.95, 2: 0.8}.get(len(look.label), 0.6)
        text = TextPath((0, 0), look.label, size=size)
        low, high = text.get_extents().get_points()
        put(
            PathPatch(
                text.transformed(
                    Affine2D().translate(x - 0.5 * (low[0] + high[0]), y - 0.5 * (low[1] + high[1]))
                )
            ),
            INK,
            gid=f"number {look.label}",
        )
    elif look.kind in ("cue", "dotted"):
        dots = "#b3262b" if look.kind == "cue" else IVORY
        for angle in (0.4, 2.5, 4.6):
            spot = (x + 0.5 * radius * np.cos(angle), y + 0.5 * radius * np.sin(angle))
            put(Circle(spot, 0.15 * radius), dots)
    put(Circle((x + 0.12 * radius, y - 0.14 * radius), 1.0 * radius), "#000000", clip=body, opacity=0.1)
    put(
        Ellipse((x - 0.38 * radius, y + 0.45 * radius), 0.5 * radius, 0.32 * radius, angle=35),
        "#ffffff",
        opacity=0.55,
    )
    axes.add_patch(
        Circle((x, y), radius, fill=False, edgecolor="#00000099", linewidth=0.3, zorder=zorder, alpha=alpha)
    )


def mixed(colour: str, other: str, share: float) -> str:
    """`#rrggbb` with a share of another."""
    parts = ((1 - share) * a + share * b for a, b in zip(_rgb(colour), _rgb(other), strict=True))
    return "#" + "".join(f"{round(255 * part):02x}" for part in parts)


def _pair(at: F64) -> tuple[float, float]:
    return float(at[0]), float(at[1])


def _rgb(css: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(css)


def _rectangle(shape: Shape, out: float) -> F64:
    x, y = shape.length + out, shape.width + out
    return np.array([(-out, -out), (x, -out), (x, y), (-out, y)])


def _ring(shape: Shape, outer: float, inner: float) -> Patch:
    """What lies between two rectangles so far outside of the noses."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    paths = [
        Path(np.vstack([part, part[:1]]), closed=True)
        for part in (_rectangle(shape, outer), _rectangle(shape, inner)[::-1])
    ]
    return PathPatch(Path.make_compound_path(*paths))


def _open(hole: Hole) -> tuple[float, float]:
    """Angles (degrees) from x between which the ring around a pocket stands."""
    toward = np.degrees(np.arctan2(-hole.axis[1], -hole.axis[0]))
    mouth = np.degrees(hole.mouth)
    return float(toward + mouth), float(toward + 360 - mouth)
