"""What a publication that used Carom should cite: the program, the paper it implements, and what its scene rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from carom.scene import Scene

SOURCES: dict[str, str] = {
    "method": "Simulation of impacts between spherical rigid bodies with frictional effects (the paper Carom implements)",
    "nsga": "O. Bruels, V. Acary, A. Cardona, Simultaneous enforcement of constraints at position and velocity levels in the"
    " nonsmooth generalized-alpha scheme, Comput. Methods Appl. Mech. Engrg. 281 (2014) 131-161; decoupled: A. Cosimo,"
    " J. Galvez, F. J. Cavalieri, A. Cardona, O. Bruels, A robust nonsmooth generalized-alpha scheme for flexible systems"
    " with impacts, Multibody Syst. Dyn. 48 (2020) 127-149",
    "sequence": "A. Cosimo, F. J. Cavalieri, A. Cardona, O. Bruels, On the adaptation of local impact laws for multiple"
    " impact problems, Nonlinear Dyn. 102 (2020) 1997-2016",
    "newton": "P. Alart, A. Curnier, A mixed formulation for frictional contact problems prone to Newton like solution"
    " methods, Comput. Methods Appl. Mech. Engrg. 92 (1991) 353-375",
    "moreau": "J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in: Nonsmooth Mechanics and"
    " Applications, CISM 302, Springer (1988) 1-82; M. Jean, The non-smooth contact dynamics method, Comput. Methods Appl."
    " Mech. Engrg. 177 (1999) 235-257",
    "rolling": "V. Acary, F. Bourrier, Coulomb friction with rolling resistance as a cone complementarity problem, Eur. J."
    " Mech. A/Solids 85 (2021) 104046",
    "penalty": "the contact force law of the run, with its source in docs/theory/penalty.md",
}
"""By what they are the source of."""


def sources(scene: Scene | None = None) -> dict[str, str]:
    """What to cite for a scene: its method, its law of impacts and of rolling, its solver; without a scene all of it."""
    if scene is None:
        return dict(SOURCES)
    run = scene.run.options()
    used = ["method"]
    if run["method"] == "penalty":
        used.append("penalty")
    else:
        used.append("moreau" if run["method"] == "moreau" else "nsga")
        used.append("newton")
        if run["impact"] != "one-shot":
            used.append("sequence")
    if any(law.rolling_radius > 0 or law.spinning_radius > 0 for law in scene._tree.contact):
        used.append("rolling")
    return {key: SOURCES[key] for key in used}


def bibtex() -> str:
    """The entry for Carom itself, with its version."""
    import carom

    return (
        "@software{carom,\n"
        "  title   = {Carom: nonsmooth contact dynamics of frictional spheres},\n"
        "  author  = {{The Carom developers}},\n"
        f"  version = {{{carom.__version__}}},\n"
        "}"
    )
