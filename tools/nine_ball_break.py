"""Write `scenarios/nine_ball_break.toml` from the billiards kit: python tools/nine_ball_break.py

Run it after a change of the kit's tables or laws; a test compares the file with what this writes.
"""

from __future__ import annotations

from pathlib import Path

from carom import billiards

FILE = Path(__file__).parents[1] / "scenarios" / "nine_ball_break.toml"
HEAD = """\
# A nine-ball break on a 9 ft table with six pockets, made by the billiards kit: python tools/nine_ball_break.py
#
# A leather tip drives the cue ball with 20 mph into the rack. Outlets take the balls out behind the edge of the slate:
# the table of events of a run says which ball left and when, `billiards.table("9ft").pocketed(result)` into which pocket.
# All balls lie still after 8.4 s. The rack is loose, 0.1 mm between balls: `seed` of `table.rack` draws another break.
"""


def text() -> str:
    """The scenario as it is shipped."""
    table = billiards.table("9ft")
    scene = table.scene("A nine-ball break on a pocket table", until=8.5, step=1e-4, record={"every": 100})
    table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=4)
    billiards.strike(table.cue_ball(scene), speed="20 mph", direction="0 deg", height=0.1)
    return HEAD + scene.to_toml()


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
