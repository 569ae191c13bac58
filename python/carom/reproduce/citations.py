"""What a publication that used Carom should cite: the program, the paper it implements, and what its scene rests on."""

from __future__ import annotations

import carom
from carom.scene.scene import Scene
from carom.scene.tables.impact_laws import LAWS

SOURCES: dict[str, str] = {
    "method": "Simulation of impacts between spherical rigid bodies with frictional effects (the paper Carom implements)",
    "nsga": "O. Bruels, V. Acary, A. Cardona, Simultaneous enforcement of constraints at position and velocity levels in the"
    " nonsmooth generalized-alpha scheme, Comput. Methods Appl. Mech. Engrg. 281 (2014) 131-161; decoupled: A. Cosimo,"
    " J. Galvez, F. J. Cavalieri, A. Cardona, O. Bruels, A robust nonsmooth generalized-alpha scheme for flexible systems"
    " with impacts, Multibody Syst. Dyn. 48 (2020) 127-149",
    "sequence": "A. Cosimo, F. J. Cavalieri, A. Cardona, O. Bruels, On the adaptation of local impact laws for multiple"
    " impact problems, Nonlinear Dyn. 102 (2020) 1997-2016",
    "poisson": "C. Glocker, F. Pfeiffer, Multiple impacts with friction in rigid multibody systems, Nonlinear Dyn. 7 (1995)"
    " 471-497",
    "binary": "C. Liu, Z. Zhao, B. Brogliato, Frictionless multiple impacts in multibody systems. I. Theoretical framework,"
    " Proc. R. Soc. A 464 (2008) 3193-3211",
    "newton": "P. Alart, A. Curnier, A mixed formulation for frictional contact problems prone to Newton like solution"
    " methods, Comput. Methods Appl. Mech. Engrg. 92 (1991) 353-375",
    "moreau": "J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in: Nonsmooth Mechanics and"
    " Applications, CISM 302, Springer (1988) 1-82; M. Jean, The non-smooth contact dynamics method, Comput. Methods Appl."
    " Mech. Engrg. 177 (1999) 235-257",
    "rolling": "V. Acary, F. Bourrier, Coulomb friction with rolling resistance as a cone complementarity problem, Eur. J."
    " Mech. A/Solids 85 (2021) 104046",
    "piles": "H. Mazhar, T. Heyn, D. Negrut, A. Tasora, Using Nesterov's method to accelerate multibody dynamics"
    " with friction and contact, ACM Trans. Graph. 34 (2015) 32 (sweeps over the contacts of large islands)",
    "penalty": "for method penalty the contact force law, which `carom cite` of the scenario or the run names",
}
"""By what they are the source of."""

FORCE_LAWS: dict[str, str] = {
    "hunt-crossley": "K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in"
    " vibroimpact, J. Appl. Mech. 42 (1975) 440-445",
    "herbert-mcwhannell": "R. G. Herbert, D. C. McWhannell, Shape and frequency composition of pulses from an"
    " impact pair, J. Eng. Ind. 99 (1977) 513-518",
    "lee-wang": "T. W. Lee, A. C. Wang, On the dynamics of intermittent-motion mechanisms. Part 1, J. Mech."
    " Trans. Autom. Des. 105 (1983) 534-540",
    "lankarani-nikravesh": "H. M. Lankarani, P. E. Nikravesh, A contact force model with hysteresis damping for"
    " impact analysis of multibody systems, J. Mech. Des. 112 (1990) 369-376",
    "gonthier": "Y. Gonthier, J. McPhee, C. Lange, J.-C. Piedboeuf, A regularized contact model with asymmetric"
    " damping and dwell-time dependent friction, Multibody Syst. Dyn. 11 (2004) 209-233",
    "zhiying-qishao": "Q. Zhiying, L. Qishao, Analysis of impact process based on restitution coefficient, J."
    " Dyn. Control 4 (2006) 294-298",
    "flores": "P. Flores, M. Machado, M. T. Silva, J. M. Martins, On the continuous contact force models for soft"
    " materials in multibody dynamics, Multibody Syst. Dyn. 25 (2011) 357-375",
    "hu-guo": "S. Hu, X. Guo, A dissipative contact force model for impact analysis in multibody dynamics,"
    " Multibody Syst. Dyn. 35 (2015) 131-151",
    "exact": "the form of K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445, with the damping that"
    " has the restitution exactly (docs/theory/penalty.md of Carom)",
}
"""Sources of `penalty_law`."""

CONTACTS_PER_BALL = 6
"""Contacts that a packing of equal balls has per ball at most: each touches 12 others, and a contact is of two."""


def sources(scene: Scene | None = None) -> dict[str, str]:
    """What to cite for a scene: its method, its law of impacts and of rolling, its solvers; without a scene all of it."""
    if scene is None:
        return dict(SOURCES)
    run = scene.run.options()
    used = ["method"]
    if run["method"] == "penalty":
        used.append("penalty")
    else:
        used += [run["method"]] if run["method"] in ("moreau", "nsga") else []  # events is of Carom
        used.append("newton")
        if CONTACTS_PER_BALL * len(scene.names) > run["pile_contacts"]:
            used.append("piles")
        used += LAWS[run["impact"]].cite
    if any(law.rolling_radius > 0 or law.spinning_radius > 0 for law in scene._tree.contact):
        used.append("rolling")
    return {key: FORCE_LAWS[run["penalty_law"]] if key == "penalty" else SOURCES[key] for key in used}


def bibtex() -> str:
    """The entry for Carom itself, with its version."""
    return (
        "@software{carom,\n"
        "  title   = {Carom: nonsmooth contact dynamics of frictional spheres},\n"
        "  author  = {{The Carom developers}},\n"
        f"  version = {{{carom.__version__}}},\n"
        "}"
    )
