"""`carom.billiards`: tables, racks and cue strikes, as scenes of Carom like any other.

    from carom import billiards

    table = billiards.table("9ft")
    scene = table.scene("a break", until=15.0, step=1e-4)
    table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=1)
    cue = table.cue_ball(scene, at="head spot")
    billiards.strike(cue, speed="20 mph", direction="0 deg", height=0.1)
    result = carom.simulate(scene, stop=carom.events.AtRest(ignore_spin=True))
    table.pocketed(result)

Nothing here is physics of its own: a cushion is a wall, a pocket an outlet, a strike the velocities after an impulse.
"""

from carom.scene.billiards import cushions
from carom.scene.billiards.cue import Strike, cue_impulse, strike
from carom.scene.billiards.data import LAWS, TABLES, TIPS, Laws, Spec, Value
from carom.scene.billiards.racks import rack_places
from carom.scene.billiards.shots import Hit, Shot
from carom.scene.billiards.table import Pocketed, Table, table

__all__ = [
    "LAWS",
    "TABLES",
    "TIPS",
    "Hit",
    "Laws",
    "Pocketed",
    "Shot",
    "Spec",
    "Strike",
    "Table",
    "Value",
    "cue_impulse",
    "cushions",
    "rack_places",
    "strike",
    "table",
]
