"""What granular people read from a run: every function takes a `Result` and the number of a frame, or a `Snapshot`.

    from carom import granular

    s = granular.snapshot(result)                                  # the last frame
    granular.coordination(s).mean
    granular.packing_fraction(s, granular.Box((0, 0, 0), (0.1, 0.1, 0.05)))
    granular.over_frames(result, granular.stress, box, start=1.0).mean("tensor")

Forces are the impulses of the contacts since the frame before, over the time between; they are recorded unless `[record]`
has `contacts = false`. Units are SI; docs/reference/granular.md has the definitions.
"""

from __future__ import annotations

from carom.measure.granular.contact import (
    Coordination,
    Fabric,
    ForceChains,
    NormalForces,
    coordination,
    fabric,
    force_chains,
    normal_forces,
)
from carom.measure.granular.density import RadialDistribution, packing_fraction, radial_distribution
from carom.measure.granular.over import Profile, Series, over_frames, over_regions
from carom.measure.granular.region import Region, ball_volume, cells, layers
from carom.measure.granular.snapshot import Contacts, Snapshot, snapshot
from carom.measure.granular.stress import Stress, Temperature, ball_stress, granular_temperature, stress
from carom.measure.granular.surface import HeapAngle, RunOut, heap_angle, run_out
from carom.measure.granular.whole import whole_box
from carom.scene.packing.periodic import PeriodicBox
from carom.scene.packing.region import Ball, Box, Cylinder

__all__ = [
    "Ball",
    "Box",
    "Contacts",
    "Coordination",
    "Cylinder",
    "Fabric",
    "ForceChains",
    "HeapAngle",
    "NormalForces",
    "PeriodicBox",
    "Profile",
    "RadialDistribution",
    "Region",
    "RunOut",
    "Series",
    "Snapshot",
    "Stress",
    "Temperature",
    "ball_stress",
    "ball_volume",
    "cells",
    "coordination",
    "fabric",
    "force_chains",
    "granular_temperature",
    "heap_angle",
    "layers",
    "normal_forces",
    "over_frames",
    "over_regions",
    "packing_fraction",
    "radial_distribution",
    "run_out",
    "snapshot",
    "stress",
    "whole_box",
]
