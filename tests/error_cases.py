"""A mistake for every message of the catalogue: a piece of a scenario, or a call, that provokes it.

A piece is added to `GOOD` of `test_bad_input`, or takes the place of something in it (`OLD -> NEW`). The key is the cause as
`error_catalogue` reads it from the source; `KEY` is what the message must call the place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from carom import Scene

SPHERE = 'material = "ball"\nradius = 0.01\nmass = 1.0\n'
LATTICE = f'[[lattice]]\nname = "l"\n{SPHERE}'
HALF = LATTICE + "counts = [1000, 600, 1]\norigin = [3,3,3]\n"
ROD = '[[joint]]\ntype = "rod"\nbetween = ["cue", "other"]\n'
MOTION = '[[joint]]\ntype = "motion"\nbody = "cue"\ndirection = [1,0,0]\n'
RACK = f'[[rack]]\nname = "r"\n{SPHERE}apex = [3,3,3]\ndirection = [1,0,0]\n'
SPRING = '[[spring]]\nbetween = ["cue", "other"]\nstiffness = 1.0\n'
WALL = '[[{0}]]\nname = "w"\nmaterial = "cloth"\n'
PLANE = WALL.format("plane") + "point = [0,0,-9]\nnormal = [0,0,1]\n"
INFLOW = f'[[inflow]]\nname = "in"\n{SPHERE}count = 2\nrate = 1.0\nseed = 1\n'
FAR = "region = { low = [3,3,3], high = [4,4,4] }\n"
PACKING = '[[packing]]\nname = "p"\nmaterial = "ball"\ndensity = 1000.0\nseed = 1\ncount = 2\n'
PRINTED = 'step = 1e-3 -> step = 1e-3\nposition_friction = "paper"\n'
CLUMP = '[[clump]]\nname = "rod"\nmaterial = "ball"\nposition = [3,3,3]\nmass = 1.0\n'
RIGID = CLUMP + "spheres = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]]\n"
RODS = INFLOW.replace("radius = 0.01", "spheres = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]]")
CORNERS = "[[9.0, 9.0, 9.0], [9.1, 9.0, 9.0], [9.0, 9.1, 9.0]]"
BOX = "low = [-1.0, -1.0, 1.0]\nhigh = [1.0, 1.0, 2.0]\n"

PERIODIC = "gravity = [0.0, 0.0, -9.8] -> gravity = [0.0, 0.0, -9.8]\nperiodic = [{0}]"
DEFORMED = "gravity = [0.0, 0.0, -9.8] -> gravity = [0.0, 0.0, -9.8]\nperiodic = [5.0, 5.0, 0.0]\ndeformation = {{ {0} }}"
IN_RUN = 'step = 1e-3\nmethod = "{0}"\n\n[world]\n'
SHEARED = DEFORMED.format('shear = { expression = "t" }, flow = "x", gradient = "y"')
ATTRACTED = (
    PERIODIC.format("5.0, 0.0, 0.0")
    + '\n\n[[contact]]\nbetween = ["ball", "ball"]\nfriction = 0.1\nrestitution = 0.5\n'
    + "cohesion = 0.1\nrupture_distance = 2.5\n"
)
STRETCHED = DEFORMED.format("stretch = [{0}, 1.0, 1.0]")

STRAINED = (
    "gravity = [0.0, 0.0, -9.8]\n\n"
    '[[material]]\nname = "ball"\n\n[[material]]\nname = "cloth"\n\n'
    '[[contact]]\nbetween = ["ball", "cloth"]\nfriction = 0.2'
    " -> gravity = [0.0, 0.0, -9.8]\nperiodic = [5.0, 5.0, 0.0]\n"
    'deformation = { shear = { expression = "300*t" }, flow = "x", gradient = "y" }\n\n'
    '[[material]]\nname = "ball"\n\n[[material]]\nname = "cloth"\n\n'
    '[[contact]]\nbetween = ["ball", "cloth"]\nfriction = 0.0'
)

SLIPPING = (
    'step = 1e-3 -> step = 1e-3\nmethod = "penalty"\npenalty_friction = "{0}"\n\n'
    '[[contact]]\nbetween = ["cloth", "cloth"]\nfriction = 0.1\nrestitution = 0.5\ntangential_restitution = {1}\n'
)


def force(z: str) -> str:
    """A load on the cue ball, upwards."""
    return f'[[load]]\non = "cue"\nforce = [0,0,{z}]\n'


#: cause -> (key that the message names, piece to add); several where several messages share the cause.
PIECES: dict[str, list[tuple[str, str]]] = {
    "... is above ..., more than any pair of solids has: such contacts stick": [
        ("friction", "friction = 0.2 -> friction = 20.0")
    ],
    "centre is given without inertia: with another centre of mass the body is not homogeneous": [
        ("clump", RIGID + "centre = [0, 0, 0]\n")
    ],
    "no body has this tensor of inertia: ...": [
        ("inertia", RIGID + "inertia = [1, 1, 3]\n"),
        ("inertia", RIGID + "inertia = [1, 1, 1, 2, 0, 0]\n"),
    ],
    "expected a list of 3 or 6 moments of inertia, found ...": [
        ("inertia", RIGID + "inertia = [1, 1]\n"),
        ("inertia", RIGID + "inertia = 3\n"),
    ],
    "a radius must be positive, found ...": [("spheres", CLUMP + "spheres = [[0, 0, 0, 0]]\n")],
    "... two balls of clump ..., which is rigid": [
        ("joint", RIGID + ROD.replace('["cue", "other"]', '["rod1", "rod2"]')),
        ("spring", RIGID + SPRING.replace('["cue", "other"]', '["rod2", "rod1"]')),
    ],
    "clumps need method nsga, found ...": [
        ("run.method", f'step = 1e-3 -> step = 1e-3\nmethod = "{method}"\n\n{RIGID}')
        for method in ("moreau", "penalty", "events")
    ],
    "clumps need position_friction once, found ...": [("run.position_friction", PRINTED + "\n" + RIGID)],
    "clumps need another impact law than ...": [
        ("run.impact", f'step = 1e-3 -> step = 1e-3\nimpact = "sequence-paper"\n\n{RIGID}')
    ],
    "a principal moment comes to ..., outside ... to ...": [
        ("inertia", RIGID + "inertia = [1e-91, 1e-91, 1e-91]\n")
    ],
    "balls ... and ... of the clump are one and the same, which would press and attract twice": [
        ("spheres", CLUMP + "spheres = [[0, 0, 0, 0.01], [0.02, 0, 0, 0.01], [0, 0, 0, 0.01]]\n")
    ],
    "clump ... is ... m long, and the period along ... ... m...": [
        (
            "spheres",
            PERIODIC.format("0.15, 0, 0")
            + "\n\n"
            + CLUMP
            + "spheres = [[0, 0, 0, 0.01], [0.16, 0, 0, 0.01]]\n",
        )
    ],
    "... enters in the course of the run, and what enters must be free": [
        ("load", INFLOW + FAR + '[[load]]\non = "in1"\nforce = [0,0,1]\n')
    ],
    "a free wall is a plane without end, and ... is given": [
        ("radius", PLANE + "radius = 1.0\nfree = { mass = 1.0 }\n")
    ],
    "both motion and free are given": [("free", PLANE + "motion = { until = 1.0 }\nfree = { mass = 1.0 }\n")],
    "both force and pressure are given": [
        ("free.pressure", PLANE + "free = { mass = 1.0, force = 1.0, pressure = 1.0, area = 1.0 }\n")
    ],
    "area is given without pressure": [("free.area", PLANE + "free = { mass = 1.0, area = 1.0 }\n")],
    "pressure without area, and no rectangle across the normal that it could act on": [
        ("free.pressure", PLANE + "free = { mass = 1.0, pressure = 1.0 }\n")
    ],
    "pressure without area, and ... beside it is taken away at ... s": [
        (
            "free.pressure",
            PERIODIC.format("5, 0, 0")
            + "\n"
            + PLANE.replace("[0,0,-9]", "[0,-9,0]").replace("[0,0,1]", "[0,1,0]").replace('"w"', '"s"')
            + PLANE.replace("[0,0,-9]", "[0,9,0]").replace("[0,0,1]", "[0,-1,0]")
            + "motion = { until = 0.5 }\n"
            + PLANE.replace('"w"', '"lid"')
            + "free = { mass = 1.0, pressure = 1.0 }\n",
        )
    ],
    "... balls do not fill a ...": [("rack", RACK + "balls = 7\n")],
    "... do not go together": [
        (
            "region",
            INFLOW
            + "region = { low = [3,3,3], high = [4,4,4], point = [0,0,0], normal = [0,0,1], radius = 1 }\n",
        )
    ],
    "... is that of one ball, and sizes differ": [
        (
            "inflow",
            INFLOW.replace("radius = 0.01\n", "")
            + FAR
            + 'sizes = "uniform"\nsmallest = 0.01\nlargest = 0.02\n',
        )
    ],
    "... = ...: the impact law ... does not read it": [
        (
            "tangential_restitution",
            'step = 1e-3\n\n[world] -> step = 1e-3\nimpact = "binary"\n\n[[material]]\nname = "glass"\n\n'
            '[[contact]]\nbetween = ["ball", "glass"]\nfriction = 0.1\nrestitution = 0.5\n'
            "tangential_restitution = 0.2\n\n[world]",
        )
    ],
    "both radius and ... are given": [
        ("inflow", INFLOW.replace("mass", "density") + FAR + "diameter = 0.02\n")
    ],
    "no size is given": [("inflow", INFLOW.replace("radius = 0.01\n", "") + FAR)],
    "is incomplete: ... missing": [("region", INFLOW + "region = { low = [3,3,3] }\n")],
    "is below low along ...": [("region", INFLOW + "region = { low = [3,3,3], high = [2,4,4] }\n")],
    "... would enter ... m deep in ...": [
        ("region", INFLOW + "region = { low = [3,3,-1], high = [4,4,4] }\n"),
        ("region", RODS + "region = { low = [3,3,-0.005], high = [4,4,4] }\n"),
    ],
    "both spheres and ... are given": [
        ("inflow", RODS + FAR + "diameter = 0.02\n"),
        ("inflow", RODS + FAR + 'sizes = "uniform"\nsmallest = 0.01\nlargest = 0.02\n'),
    ],
    "orientation is given without spheres": [("inflow", INFLOW + FAR + "orientation = [1, 0, 0, 0]\n")],
    "balls would leave where they enter: the region lies where an outlet removes them": [
        ("region", INFLOW + FAR + "[[outlet]]\nlow = [2,2,2]\nhigh = [5,5,5]\n")
    ],
    "balls that enter in a part of the region leave at once: an outlet removes them there": [
        ("region", INFLOW + FAR + "[[outlet]]\nlow = [3.9,2,2]\nhigh = [5,5,5]\n")
    ],
    "no ball enters: the run ends at ... s, before ... s": [("start", INFLOW + FAR + "start = 10.0\n")],
    "all balls that are there at the start leave at once: they start where it removes them": [
        ("outlet", "[[outlet]]\nlow = [-9,-9,-9]\nhigh = [9,9,9]\n")
    ],
    "... leaves at once: it starts where balls are removed...": [
        ("outlet", "[[outlet]]\nlow = [0.4,-9,-9]\nhigh = [9,9,9]\n")
    ],
    "is not above low along ...": [("outlet", "[[outlet]]\nlow = [2,2,2]\nhigh = [1,5,5]\n")],
    "... has ... times the mass of ..., more than ...: contacts of both are solved slowly, and energy may rise": [
        (
            "mass",
            '[[sphere]]\nname = "heavy"\nmaterial = "ball"\nradius = 0.01\nmass = 1e5\nposition = [3,3,3]\n',
        )
    ],
    "... is declared twice": [("name", '[[material]]\nname = "ball"\n')],
    "... is no kind of law": [("load", force('{ formula = "t" }'))],
    "a key of ... parts": [("deep", "deep" + 1000 * ".a" + " = 1\n")],
    "a law has one key, found ...": [("load", force('{ expression = "t", table = [[0,0],[1,1]] }'))],
    "... must rise from point to point, found ... after ...": [("load", force("{ table = [[1,0],[0,1]] }"))],
    "must be ... everywhere, found ... at ... = ...": [
        ("contact", "restitution = 0.5 -> restitution = { table = [[0, 0.5], [1, 2.0]] }")
    ],
    "is ..., and the friction spring of method penalty leaves no slip over": [
        ("tangential_restitution", SLIPPING.format("spring", -0.5))
    ],
    "is ..., and regularised friction of method penalty has none": [
        ("tangential_restitution", SLIPPING.format("regularised", 0.5))
    ],
    "rupture_distance is given without cohesion": [
        ("contact", "restitution = 0.5 -> restitution = 0.5\nrupture_distance = 1e-4")
    ],
    "cohesion needs a rupture_distance above 0": [
        ("contact", "restitution = 0.5 -> restitution = 0.5\ncohesion = 0.1")
    ],
    "expected a formula, found ...": [("load", force("{ expression = 3 }"))],
    "cannot read ...: ...": [
        ("load", force('{ expression = "2*" }')),
        ("parameters", '[parameters]\nx = "= 8 deg"\n'),
    ],
    "no material is declared": [
        ("contact", '[[material]]\nname = "ball"\n\n[[material]]\nname = "cloth"\n\n -> \n')
    ],
    "unknown name ... in ...": [("load", force('{ expression = "x" }'))],
    "expected a list of ..., found ...": [("load", force("{ table = 3 }"))],
    "expected ... to ... ..., found ...": [("load", force("{ table = [[0,0]] }"))],
    "expected a list of 3 numbers or laws, found ...": [("load", '[[load]]\non = "cue"\nforce = [0,0]\n')],
    "expected a number or a law, found ...": [("friction", "friction = 0.2 -> friction = [1.0]")],
    "has no finite value at ... = 0...": [("load", force('{ expression = "1/t" }'))],
    "neither force nor torque is given": [("load", '[[load]]\non = "cue"\n')],
    "... has no finite value at t = ... s...": [
        ("motion", PLANE + 'motion = { translation = [0,0,{ expression = "t/(0.5-t)" }] }\n')
    ],
    "has no finite value at t = ... s...": [
        ("world.deformation", STRETCHED.replace("{0}", '{ expression = "1 + t/(0.5-t)" }')),
        ("load", force('{ expression = "1/(0.5-t)" }')),
    ],
    "has no finite slope at ... = 0, where it moves something": [
        ("joint", MOTION + 'displacement = { expression = "0.1*sqrt(t)" }\n')
    ],
    "... is no sphere": [("load", '[[load]]\non = "ground"\nforce = [0,0,1]\n')],
    'a sphere is called "all", which here means every sphere': [
        (
            "drag",
            f'[[sphere]]\nname = "all"\n{SPHERE}position = [3,3,3]\n[[drag]]\non = "all"\ntranslation = 1.0\n',
        )
    ],
    "translation and rotation are both zero": [("drag", '[[drag]]\non = "cue"\ntranslation = 0.0\n')],
    "... stands on both sides": [("between", '[[spring]]\nbetween = ["cue", "cue"]\nstiffness = 1.0\n')],
    "expected two ... names, found ...": [("between", '[[spring]]\nbetween = ["cue"]\nstiffness = 1.0\n')],
    "is missing: a point of the ground must be given": [
        ("points", '[[spring]]\nbetween = ["cue", "ground"]\nstiffness = 1.0\n')
    ],
    "expected ... vectors, found ...": [("points", SPRING + "points = [[0,0,0]]\n")],
    "stiffness and damping are both zero": [
        ("spring", '[[spring]]\nbetween = ["cue", "other"]\nstiffness = 0.0\n')
    ],
    "its period is about ... s, ... steps of ... s": [
        ("spring", '[[spring]]\nbetween = ["cue", "other"]\nstiffness = 1e9\n')
    ],
    "motion decays in ... s, ... steps of ... s...": [
        ("drag", '[[drag]]\non = "all"\nrotation = 1e9\n'),
        ("spring", '[[spring]]\nbetween = ["cue", "other"]\ndamping = 1e9\n'),
    ],
    "both ends of the spring are at the same point, so that it has no direction": [
        ("spring", SPRING + "rest_length = 0.1\npoints = [[0.25,0,0.028575],[0.25,0,0.028575]]\n")
    ],
    "there are two load functions ...": [
        ("name", '[[load_function]]\nname = "f"\n[[load_function]]\nname = "f"\n')
    ],
    "the Python function ... is not there: no file can hold it": [
        ("load_function", '[[load_function]]\nname = "f"\n')
    ],
    "... kg m^2 is more than that of a hollow sphere (...)": [
        ("inertia", f'[[sphere]]\nname = "s"\n{SPHERE}inertia = 1.0\nposition = [3,3,3]\n')
    ],
    "... m is not below friction times radius, ... m: a sliding ball never starts to roll": [
        ("rolling_radius", "restitution = 0.5 -> restitution = 0.5\nrolling_radius = 0.02")
    ],
    "a diamond has an odd number of rows, found ...": [
        (
            "rack",
            f'[[rack]]\nname = "r"\nshape = "diamond"\n{SPHERE}rows = 2\napex = [3,3,3]\ndirection = [1,0,0]\n',
        )
    ],
    "direction and up are parallel": [
        ("rack", f'[[rack]]\nname = "r"\n{SPHERE}rows = 2\napex = [3,3,3]\ndirection = [0,0,1]\n')
    ],
    "jitter is given without a seed": [("rack", RACK + "rows = 2\njitter = 0.1\n")],
    "makes ... balls, more than ...": [
        ("lattice", LATTICE + "counts = [1000, 1000, 1000]\norigin = [3,3,3]\n")
    ],
    "with this table there are more than ... balls": [("lattice", HALF + HALF.replace('"l"', '"k"'))],
    "... steps write about ... GB: each has a row in the table of steps": [
        ("run.until", "until = 1.0 -> until = 1e6")
    ],
    "frames with contacts and motion of every ball take up to about ... GB": [
        (
            "record.every",
            f'[record]\nevery = 1\n[[lattice]]\nname = "l"\n{SPHERE}counts = [20, 20, 20]\norigin = [3,3,3]\n',
        )
    ],
    "expected a list of ... whole numbers, found ...": [
        ("lattice", LATTICE + "counts = [2, 2]\norigin = [3,3,3]\n")
    ],
    "spheres ... overlap at the start, gap ... m": [
        ("lattice", LATTICE + "counts = [1, 1, 1]\norigin = [0.0, 0.0, 0.03]\n")
    ],
    "... under gravity make a pile: pile_tolerance = ... takes ... times as long as ..., or stops unconverged": [
        ("run.pile_tolerance", LATTICE + "counts = [10, 10, 5]\nspacing = 0.03\norigin = [3,3,3]\n")
    ],
    '... under gravity make a pile: position_friction = "paper" takes ... times as long as "once"': [
        (
            "run.position_friction",
            'step = 1e-3 -> step = 1e-3\npile_tolerance = 1e-4\nposition_friction = "paper"\n'
            + LATTICE
            + "counts = [10, 10, 5]\nspacing = 0.03\norigin = [3,3,3]\n",
        )
    ],
    "a ... has no periodic axes": [
        (
            "packing",
            PACKING
            + 'diameter = 0.01\nregion = "sphere"\nperiodic = "x"\npoint = [3,3,3]\nregion_radius = 1.0\n',
        )
    ],
    "... cannot be had of whole balls: the fraction of ... is ...": [
        (
            "fraction",
            PACKING.replace("count = 2", "fraction = 1e-9")
            + "diameter = 0.01\nlow = [3,3,3]\nhigh = [4,4,4]\n",
        )
    ],
    "low is not below high along each axis": [
        ("packing", PACKING + "diameter = 0.01\nlow = [3,3,3]\nhigh = [4,4,2]\n")
    ],
    "smallest is above largest": [
        (
            "packing",
            PACKING + 'sizes = "uniform"\nsmallest = 0.2\nlargest = 0.1\nlow = [3,3,3]\nhigh = [4,4,4]\n',
        )
    ],
    "diameters and shares of the table must be positive": [
        (
            "classes",
            PACKING + 'sizes = "table"\nclasses = [[0.1, 0.0], [0.2, 1.0]]\nlow = [3,3,3]\nhigh = [4,4,4]\n',
        )
    ],
    "... has no key ...": [
        ("packing", PACKING + "diameter = 0.01\nmean = 0.1\nlow = [3,3,3]\nhigh = [4,4,4]\n")
    ],
    "... needs ...": [("packing", PACKING + "diameter = 0.01\nlow = [3,3,3]\n")],
    "a period of ... m along ... is below ... radii of the largest ball...": [
        ("world.periodic", PERIODIC.format("0.1, 0.0, 0.0")),
        ("world.periodic", ATTRACTED),
    ],
    "neither stretch nor shear is given": [("world.deformation", DEFORMED.format(""))],
    "shear is given without ...": [
        ("world.deformation", DEFORMED.format('shear = { expression = "t" }, flow = "x"')),
        ("world.deformation", DEFORMED.format('shear = { expression = "t" }, gradient = "x"')),
    ],
    "... is given without shear": [
        ("world.deformation", DEFORMED.format('stretch = [1.0, 1.0, 1.0], flow = "x"'))
    ],
    'flow and gradient are both "..."': [
        ("world.deformation", DEFORMED.format('shear = { expression = "t" }, flow = "x", gradient = "x"'))
    ],
    "must be ... at t = 0, found ...": [
        ("world.deformation", STRETCHED.replace("{0}", "1.1")),
        ("world.deformation", STRETCHED.replace("{0}", '{ expression = "2 + t" }')),
        ("world.deformation", DEFORMED.format('shear = 0.5, flow = "x", gradient = "y"')),
        (
            "world.deformation",
            DEFORMED.format('shear = { polynomial = [0.5, 1.0] }, flow = "x", gradient = "y"'),
        ),
    ],
    "deformation is given without periodic: there is no box that deforms": [
        ("world.deformation", SHEARED.replace("periodic = [5.0, 5.0, 0.0]\n", "")),
        ("world.deformation", SHEARED.replace("[5.0, 5.0, 0.0]", "[0.0, 0.0, 0.0]")),
    ],
    "stretches ..., along which the world does not repeat": [
        ("world.deformation", DEFORMED.format('stretch = [1.0, 1.0, { expression = "1 + t" }]'))
    ],
    "... is along ..., along which the world does not repeat": [
        ("world.deformation", SHEARED.replace('gradient = "y"', 'gradient = "z"')),
        ("world.deformation", SHEARED.replace('flow = "x"', 'flow = "z"')),
    ],
    "comes to ... at t = ... s, and a length stays above 0": [
        ("world.deformation", STRETCHED.replace("{0}", '{ expression = "1 - 2*t" }'))
    ],
    "a periodic box that deforms needs method ..., found ...": [
        ("run.method", f"step = 1e-3\n\n[world]\n{SHEARED}".replace("-> ", f"-> {IN_RUN.format(method)}"))
        for method in ("penalty", "events")
    ],
    "friction at ..., which does not go along with a periodic box that deforms": [
        ("friction", SHEARED),
    ],
    "[[...]] does not go with a periodic box that deforms": [
        ("inflow", SHEARED + "\n\n" + INFLOW + FAR),
        ("outlet", SHEARED + "\n\n[[outlet]]\nlow = [9,9,9]\nhigh = [10,10,10]\n"),
    ],
    "balls that are joined do not go along with a periodic box that deforms": [
        ("joint", SHEARED + "\n\n" + ROD),
    ],
    "shortens the period along ... to ... m at t = ... s, below ... radii of the largest ball...": [
        ("world.deformation", STRETCHED.replace("{0}", "{ table = [[0.0, 1.0], [0.5, 0.01]] }"))
    ],
    "... is not the same from period to period along ...": [("plane", PERIODIC.format("0.0, 0.0, 5.0"))],
    "... turns about an axis that is not along ..., which is periodic": [
        (
            "motion.rotation",
            "gravity = [0.0, 0.0, -9.8] -> gravity = [0.0, 0.0, -9.8]\nperiodic = [5.0, 0.0, 0.0]\n"
            + WALL.format("plane")
            + "point = [0,0,-9]\nnormal = [0,0,1]\nmotion = { rotation = { axis = [0,0,1], rate = 1 } }",
        ),
        (
            "motion.surface_rotation",
            "gravity = [0.0, 0.0, -9.8] -> gravity = [0.0, 0.0, -9.8]\nperiodic = [5.0, 0.0, 0.0]\n"
            + WALL.format("plane")
            + "point = [0,0,-9]\nnormal = [0,0,1]\nmotion = { surface_rotation = { axis = [0,0,1], rate = 1 } }",
        ),
    ],
    "is ... m, and walls have lengths from ... to ... m": [
        ("radius", WALL.format("cylinder") + "point = [0,0,0]\naxis = [0,0,1]\nradius = 1e200\n"),
        ("size", PLANE + "size = [1e-80, 1]\n"),
        ("radius", WALL.format("ball_wall") + "point = [0,0,0]\nradius = 1e-80\ninside = false\n"),
    ],
    "a step of ... s moves ... by ... radii: impacts on planes may be missed": [
        ("run.step", "step = 1e-3 -> step = 0.1")
    ],
    "falling, ... reaches ... m/s at ...: a step of ... s moves it by ... radii": [
        (
            "run.step",
            '[[sphere]]\nname = "s"\nmaterial = "ball"\nradius = 0.005\nmass = 0.1\nposition = [9,9,4]\n',
        )
    ],
    "a step of ... s moves ... by ... radii: oblique hits lose accuracy and grazing ones may be missed": [
        ("run.step", "[0.5, 0.0, 0.028575] -> [0.5, 0.0, 0.028575]\nvelocity = [10.0, 0.0, 0.0]")
    ],
    "a step of ... s strains the periodic box by ...: neighbours pass each other unnoticed": [
        ("run.step", STRAINED)
    ],
    "until = ... s is not a whole number of steps": [("run.until", "until = 1.0 -> until = 1.0004")],
    "until = ... s is not a whole number of frames, which are ... s apart": [
        ("run.until", 'until = 1.0 -> until = 1.0004\nmethod = "events"')
    ],
    "until = ... s is shorter than the ... s between two frames": [
        ("run.until", 'until = 1.0 -> until = 1e-4\nmethod = "events"')
    ],
    "e_N = 1 on plane ... against gravity: each bounce ... energy of the order of the step": [
        ("restitution", "restitution = 0.5 -> restitution = 1.0")
    ],
    "the coefficient is ... at an approach of ... m/s": [
        (
            "restitution",
            "[0.5, 0.0, 0.028575] -> [0.5, 0.0, 0.028575]\nvelocity = [1.0, 0.0, 0.0]\n"
            '[[material]]\nname = "ice"\n[[contact]]\nbetween = ["ice", "ball"]\nfriction = 0\n'
            'restitution = "0.9 - v"\n',
        )
    ],
    "the coefficient is ... at a slip of ... m/s": [
        (
            "friction",
            "[0.5, 0.0, 0.028575] -> [0.5, 0.0, 0.028575]\nvelocity = [1.0, 0.0, 0.0]\n"
            '[[material]]\nname = "ice"\n[[contact]]\nbetween = ["ice", "ice"]\nrestitution = 0\n'
            'friction = { expression = "0.2 - v" }\n',
        )
    ],
    "must be ... at ... = 0, found ...": [
        ("friction", 'friction = 0.2 -> friction = { expression = "v - 1" }')
    ],
    "... m/s of it are along the normal of ...: a surface slips only within itself": [
        ("motion.surface_velocity", PLANE + "motion = { surface_velocity = [1,0,1] }\n")
    ],
    "... reaches ... m/s, more than the ... m/s of any run": [
        ("motion", PLANE + 'motion = { translation = [0,0,{ expression = "1e300*t" }] }\n')
    ],
    "the wall stays: the run ends at ... s, and it would be taken away at ... s": [
        ("motion", PLANE + "motion = { until = 2.0 }\n")
    ],
    "the law jumps by ... ... at t = ... s": [
        (
            "motion.translation",
            PLANE + 'motion = { translation = [0,0,{ expression = "0.001*floor(t/0.3)" }] }\n',
        ),
        (
            "motion.rotation",
            PLANE
            + 'motion = { rotation = { axis = [0,0,1], angle = { expression = "0.01*(1+sign(t-0.5))" } } }\n',
        ),
        ("displacement", MOTION + 'displacement = { expression = "0.001*floor(t/0.3)" }\n'),
    ],
    "the law changes by ... ... in a step of ... s": [
        ("displacement", MOTION + 'displacement = { expression = "10*t^2" }\n'),
    ],
    "method ... does not read it": [("run.theta", "step = 1e-3 -> step = 1e-3\ntheta = 0.7")],
    "a step of ... s moves ... by ... radii of the smallest ball": [
        (
            "motion",
            WALL.format("plane") + "point = [0,0,-999]\nnormal = [0,0,1]\n"
            'motion = { translation = [0,0,{ expression = "100*t" }] }\n',
        )
    ],
    "balls of radius ... m do not pass the narrow end of ...: one that sits on the whole ring stops the run": [
        (
            "cone",
            WALL.format("cone")
            + "point = [0,0,-9]\naxis = [0,0,1]\nradius = 0\nradius_end = 20\nlength = 20\ninside = true\n",
        )
    ],
    "balls of radius ... m do not pass the hole of ...: one near its axis gains energy, falls through or stops the run": [
        ("hole", PLANE + "radius = 1.0\nhole = 0.001\n")
    ],
    "... are given without ...": [("mesh", WALL.format("mesh") + f"vertices = {CORNERS}\n")],
    "expected rows of three ...": [
        ("mesh", WALL.format("mesh") + "vertices = [[0, 1]]\ntriangles = [[0, 1, 2]]\n")
    ],
    "triangles ... name points that are not there": [
        ("mesh", WALL.format("mesh") + f"vertices = {CORNERS}\ntriangles = [[0, 1, 3]]\n")
    ],
    "triangles ... have their corners on one line": [
        ("mesh", WALL.format("mesh") + f"vertices = {CORNERS}\ntriangles = [[0, 1, 2], [0, 1, 1]]\n")
    ],
    "no triangle has an area": [
        ("mesh", WALL.format("mesh") + f"vertices = {CORNERS}\ntriangles = [[0, 1, 1]]\nclean = true\n")
    ],
    "points ... are not finite": [
        (
            "mesh",
            WALL.format("mesh") + "vertices = [[0, 0, nan], [1, 0, 0], [0, 1, 0]]\ntriangles = [[0, 1, 2]]\n",
        )
    ],
    "there is no file ...": [("mesh", WALL.format("mesh") + 'file = "nowhere.stl"\n')],
    "... is no file": [("mesh", WALL.format("mesh") + 'file = "/"\n')],
    "... cannot be read (...)": [("mesh", WALL.format("mesh") + f'file = "{"x" * 999}"\n')],
    "... is no mesh that trimesh reads (...: ...)": [
        ("mesh", WALL.format("mesh") + f'file = "{__file__}"\n')
    ],
    "must be 0 at t = 0, where the wall stands as written; found ...": [
        ("motion", PLANE + "motion = { translation = [0,0,{ table = [[0,1],[1,2]] }] }\n")
    ],
    "none of ... is given": [("motion", PLANE + "motion = {}\n")],
    "expected a table, found ...": [
        ("motion", PLANE + "motion = 3\n"),
        ("case", "format = 1 -> format = 1\ncase = [3]"),
    ],
    "all six sides are open": [
        ("open", WALL.format("box") + BOX + 'open = ["low_x","high_x","low_y","high_y","low_z","high_z"]\n')
    ],
    "expected a list of sides, found ...": [("open", WALL.format("box") + BOX + "open = 3\n")],
    "names ... twice": [("open", WALL.format("box") + BOX + 'open = ["low_x", "low_x"]\n')],
    "is not above low along ...: ... m after ... m": [
        ("high", WALL.format("box") + "low = [-1,-1,1]\nhigh = [1,1,0]\n")
    ],
    "sphere ... is outside box ..., which is closed": [("position", WALL.format("box") + BOX)],
    "sphere ... reaches ... m into ...": [
        ("position", WALL.format("ball_wall") + "point = [0,0,0]\nradius = 0.01\ninside = false\n")
    ],
    "both size (a rectangle) and radius (a disc) are given": [
        ("plane", PLANE + "size = [1,1]\nradius = 1\n")
    ],
    "side is given without size": [("side", PLANE + "side = [1,0,0]\n")],
    "is parallel to the normal": [("side", PLANE + "size = [1,1]\nside = [0,0,1]\n")],
    "radius and radius_end are equal: this is a cylinder": [
        (
            "cone",
            WALL.format("cone")
            + "point = [0,0,-9]\naxis = [0,0,1]\nradius = 1\nradius_end = 1\nlength = 1\n",
        )
    ],
    "begins or ends with a blank: ...": [("name", '[[material]]\nname = " x"\n')],
    "expected a string, found ...": [("name", "[[material]]\nname = 3\n")],
    "expected tables, found ...": [("lattice", "format = 1 -> format = 1\nlattice = 3")],
    "... can take the load of the contact of ... with ...: friction there vanishes or is undetermined": [
        ("joint", '[[joint]]\ntype = "plane"\nbody = "cue"\nnormal = [0,0,1]\n')
    ],
    "... holds ... against ..., and neither gives way": [
        ("joint", MOTION.replace("[1,0,0]", "[0,0,1]") + 'displacement = "-0.01*t^2"\n')
    ],
    "... runs inside ... at up to ... m/s, ... m from its middle: a step of ... s loses about ..."
    " (estimate without friction and hits)": [
        (
            "run.step",
            PRINTED
            + WALL.format("cylinder")
            + "point = [3,0,1]\naxis = [0,1,0]\nradius = 0.2\nlength = 0.1\n"
            + f'[[sphere]]\nname = "third"\n{SPHERE}position = [3.19,0,1]\nvelocity = [0,0,3]\n',
        )
    ],
    "... rolls down ..., ... m from its middle: a step of ... s gains about ... % of its energy (estimate)": [
        (
            "run.step",
            PRINTED
            + WALL.format("ball_wall")
            + "point = [3,0,1]\nradius = 0.001\ninside = false\n"
            + '[[sphere]]\nname = "third"\nmaterial = "ball"\nradius = 0.001\nmass = 0.1\nposition = [3,0,1.002]\n',
        )
    ],
    "... hold the same motion as other joints": [("joint", ROD + ROD)],
    "is ... ... at t = 0, but counts from the start": [
        (
            "joint",
            '[[joint]]\ntype = "motion"\nbody = "cue"\ndirection = [1,0,0]\ndisplacement = { expression = "1 + t" }\n',
        )
    ],
    "a joint of type ... has either ...": [
        ("joint", MOTION + "axis = [0,0,1]\ndisplacement = 0.0\nangle = 0.0\n")
    ],
    "the ... axes are parallel or lie in a plane": [
        ("joint", '[[joint]]\ntype = "lock"\nbody = "cue"\naxes = [[0,0,1],[0,0,2]]\n')
    ],
    "there are two joints ...": [
        (
            "name",
            '[[joint]]\nname = "j"\ntype = "rod"\nbetween = ["cue", "other"]\n'
            '[[joint]]\nname = "j"\ntype = "lock"\nbetween = ["cue", "other"]\n',
        )
    ],
    "is missing in a joint of type ...": [
        ("joint", '[[joint]]\ntype = "ball"\nbetween = ["cue", "other"]\n')
    ],
    "a joint of type ... has no key ...": [("joint", ROD + "axis = [0,0,1]\n")],
    "both ends of the rod are at the same point": [
        ("joint", ROD + "points = [[0.25,0,0.028575],[0.25,0,0.028575]]\n")
    ],
    "is ... m at t = 0, but the ends are ... m apart": [("joint", ROD + "length = 0.4\n")],
    "falls to ... m at t = ... s": [("joint", ROD + 'length = { expression = "0.5 - t^2" }\n')],
    "expected any number of tables, found ...": [("case", "[case]\nx = 1\n")],
    "expected one table, found ...": [("parameters", "[[parameters]]\nx = 1\n")],
    "expected a number or an expression, found ...": [("parameters", "[parameters]\nx = true\n")],
    "... may mean the unit or the parameter ...": [
        ("parameters", '[parameters]\nm = 1.0\nx = "2*m"\n'),
        ("radius", '[parameters]\nm = 1.0\n[[sphere]]\nname = "b"\nradius = "2*m"\n'),
    ],
    "... may mean the unit t, tonnes, or the time": [("parameters", '[parameters]\nx = "2*t"\n')],
    "is not used anywhere": [("parameters", "[parameters]\nx = 1.0\n")],
    "is the name of case number ... too": [("case", '[[case]]\nname = "a"\n[[case]]\nname = "a"\n')],
    "is not in [parameters]": [("case", '[[case]]\nname = "a"\nx = 1.0\n')],
    "... has no finite value: ...": [("parameters", '[parameters]\nx = "= 1/0"\n')],
    "unknown name ... in ... at column ...": [
        ("parameters", '[parameters]\nx = "= y"\ny = 1.0\n'),
        ("until", 'until = 1.0 -> until = "= y"'),
        ("until", '[run]\nuntil = 1.0 -> [parameters]\nyy = 1.0\n[run]\nuntil = "= y"'),
    ],
    "... is not a number: it depends on ...": [("load", force('"= 2*t"'))],
    'the formula of a law has no "=" in front: ...': [("load", force('{ expression = "= t" }'))],
}


def _scene() -> Scene:
    scene = Scene("calls", run={"until": 1.0})
    scene.sphere("a", radius=1, mass=1, at=(0, 0, 0), material="m")
    return scene


def _force(*_: Any) -> np.ndarray:
    return np.zeros((1, 6))


def _rods(**keys: Any) -> Any:
    rod = [[0, 0, 0, 0.1], [0.1, 0, 0, 0.1]]
    region = {"low": (2, 2, 2), "high": (3, 3, 3)}
    return _scene().clump_packing("rod", spheres=rod, material="m", density=1, seed=1, **region, **keys)


#: The same of mistakes that only calls can make: cause -> (part of the place, the call).
CALLED: dict[str, tuple[str, Callable[[], Any]]] = {
    "... is not within 0 and ...: what is packed are balls about the clumps": (
        "fraction",
        lambda: _rods(fraction=0.9),
    ),
    "balls about the clumps, of ... times their volume, do not fit: ...": ("count", lambda: _rods(count=500)),
    "unknown keyword": (
        "Scene.sphere",
        lambda: _scene().sphere("b", radius=1, mass=1, at=(3, 0, 0), material="m", colour=1),  # type: ignore[call-arg]
    ),
    "... can be given without a name": ("Scene.sphere", lambda: _scene().sphere("b", 1.0, "m")),  # type: ignore[call-arg, misc]
    "both position and at are given": (
        "at",
        lambda: _scene().sphere("b", radius=1, mass=1, at=(3, 0, 0), position=(3, 0, 0), material="m"),
    ),
    "there is already a sphere, clump or wall ...": (
        "name",
        lambda: _scene().sphere("a", radius=1, mass=1, at=(3, 0, 0), material="m"),
    ),
    "there is already a law for ... and ...": (
        "Scene.contact",
        lambda: [s.contact("a", "b", friction=0, restitution=0) for s in [_scene()] for _ in range(2)],
    ),
    "expected a function, found ...": ("load_function", lambda: _scene().load_function(3)),  # type: ignore[arg-type]
    "there is already a load function ...": (
        "name",
        lambda: [s.load_function(_force, name="f") for s in [_scene()] for _ in range(2)],
    ),
    "a formula of ... stands by itself, found ...": (
        "friction",
        lambda: _scene().contact("a", "b", friction="= 0.3", restitution=0),
    ),
    "expected a number or a law, found a function": (
        "friction",
        lambda: _scene().contact("a", "b", friction=_force, restitution=0),  # type: ignore[arg-type]
    ),
}
