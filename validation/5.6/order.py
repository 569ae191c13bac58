"""Section 5.6: how the billiard break converges with the step h, before and after the impact, and long after.

    python validation/5.6/order.py [--quick] [--json] [--figure FOLDER]

Before the impact (t = 0.11 s) the velocities are exact at any h. After it (t = 0.13 s) their error
is of first order: the scheme finds the impact at the end of the step in which it happens, up to h too late,
and friction and the turned normals act for that long. So two kinds of steps are run: round ones, as a person
would choose them, whose impact is delayed by anything between 0 and h; and steps that all have the impact in
their middle, from which the order is read. The reference is a step of about 1e-6 s that ends on the impact.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from common import Bounds, table
from measure import AFTER, BALLS, BEFORE, KEYS, LATE, LAWS, measure


def judge(found: dict[str, Any]) -> Bounds:
    """The measured values against bounds.toml."""
    bounds = Bounds(Path(__file__).with_name("bounds.toml"))
    exact = found["exact"]
    runs = [r for law in LAWS for r in found["whole"][law]]
    points = [p for law in LAWS for family in found["laws"][law].values() for p in family]
    bounds.check("before", found["before"])
    bounds.check("contact_time", max(abs(r["contact_time"] / exact["time"] - 1) for r in runs))
    bounds.check("contact_speed", max(abs(r["contact_speed"] / exact["speed"] - 1) for r in runs))
    bounds.check("contact_step", max(abs(r["contact_step"] - r["contact_step_expected"]) for r in runs))
    for when in ("impact", "after"):
        for short in KEYS:
            bounds.check(
                f"order_{when}_{short}", min(found["orders"][law][f"{when} {short}"] for law in LAWS)
            )
    bounds.check("unconverged", sum(r["unconverged"] for r in runs) + sum(not p.converged for p in points))
    bounds.check("penetration", max(r["penetration"] for r in runs))
    default = found["whole"]["sequence"]
    bounds.check("energy_rise", max(r["energy_rise"] for r in default))
    bounds.check("mirror_after", max(p.mirror for p in points))
    bounds.check("mirror", max(found["whole"][law][0]["mirror"] for law in LAWS))
    finest = {law: min(found["laws"][law]["middle"], key=lambda p: p.h) for law in LAWS}
    bounds.check("cue_back", finest["sequence"].cue[0])
    bounds.check("cue_up", finest["sequence"].cue[2])
    bounds.check("laws_agree", abs(finest["sequence"].cue[0] - finest["sequence-paper"].cue[0]))
    return bounds


def told(found: dict[str, Any]) -> str:
    """The tables for a terminal."""
    exact = found["exact"]
    parts = [
        f"Billiard break, section 5.6. Contact at {exact['time']:.7f} s with {exact['speed']:.6f} m/s (closed form).",
        f"t = {BEFORE} s, before the impact: velocity, spin and way are those of the closed form to {found['before']:.1e}.",
        f"t = {AFTER} s, after it: errors by eq. 45 against h = {found['reference']:.4e} s.",
    ]
    for law in LAWS:
        rows = [
            [
                f"{family} {p.h:.3e}",
                f"{1e6 * p.delay:.1f}",
                *(f"{x:.2e}" for x in (*p.impact.values(), *p.after.values())),
                f"{p.after['v'] / p.delay:.1f}",
                f"{p.cue[0]:.5f}",
                f"{p.cue[2]:.5f}",
            ]
            for family, points in found["laws"][law].items()
            for p in points
        ]
        head = [
            "h (s)",
            "delay (us)",
            "impact v",
            "impact w",
            "0.13 s v",
            "0.13 s w",
            "v / delay",
            "cue v_x",
            "cue v_z",
        ]
        orders = ", ".join(f"{k} {v:.2f}" for k, v in found["orders"][law].items())
        parts += [
            f"\nLaw {law}",
            table(head, rows),
            f"order, steps with the impact in their middle: {orders}",
        ]
        head = ["h (s)", *(f"{ball} {short}" for ball in BALLS for short in KEYS)]
        rows = [
            [f"{p.h:.3e}", *(f"{x:.1e}" for ball in p.by_ball for x in ball)]
            for p in found["laws"][law]["middle"]
        ]
        parts += [f"\nThe same at {AFTER} s, ball by ball", table(head, rows)]
    parts += ["", *_late(found), ""]
    return "\n".join(parts)


def _late(found: dict[str, Any]) -> list[str]:
    parts = []
    for law in LAWS:
        runs = found["whole"][law]
        finest = np.asarray(runs[-1]["position"])
        rows = []
        for r in runs:
            off = np.max(np.linalg.norm(np.asarray(r["position"]) - finest, axis=1))
            rows.append(
                [
                    f"{r['h']:.0e}",
                    str(r["steps"]),
                    str(r["unconverged"]),
                    str(r["fallbacks"]),
                    f"{r['contact_step'] * r['h']:.5f}",
                    f"{r['cue_vz']:.4f}",
                    f"{1e3 * r['jump']:.3f}",
                    f"{r['penetration']:.1e}",
                    f"{r['energy_rise']:.1e}",
                    f"{r['mirror']:.0e}",
                    f"{off:.3f}" if r is not runs[-1] else "-",
                ]
            )
        head = [
            "h (s)",
            "steps",
            "unconverged",
            "fallbacks",
            "impact (s)",
            "cue v_z",
            "jump (mm)",
            "penetration (r)",
        ]
        parts += [
            f"Whole runs of {LATE:g} s, law {law}",
            table([*head, "energy rise", "mirror (m)", "3 s off (m)"], rows),
        ]
    parts.append(
        "Later states are sensitive to O(h): every ball and cushion met multiplies the differences. The last column is the"
        "\ngreatest distance at 3 s between a ball and itself in the finest run. Compare velocities just after the impact."
    )
    return parts


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="fewer and coarser steps: what the tests run")
    parser.add_argument("--json", action="store_true", help="print one JSON document and nothing else")
    parser.add_argument(
        "--figure", type=Path, metavar="FOLDER", help="also write 5.6_order.png into this folder"
    )
    options = parser.parse_args()
    found = measure(options.quick)
    bounds = judge(found)
    if options.figure:
        from figure import draw

        path = draw(found, options.figure)
    if options.json:
        checks = [check.as_json() for check in bounds.checks]
        print(json.dumps({**found, "checks": checks, "unused": sorted(bounds.unused())}, default=vars))
    else:
        print(told(found))
        print(bounds.table())
        if options.figure:
            print(f"\n{path}")
    return 0 if bounds.ok else 1


if __name__ == "__main__":
    sys.exit(main())
