"""`carom cite`."""

from __future__ import annotations

from carom.cli.options import Json
from carom.cli.output import emit, guarded

#: The work whose method Carom implements, and what each part of it rests on.
SOURCES = {
    "method": "Simulation of impacts between spherical rigid bodies with frictional effects (the paper Carom implements)",
    "nsga": "Bruels and co-workers: the nonsmooth generalized-alpha scheme (in the references of that paper)",
    "sequence": "Cosimo and co-workers: multiple impacts as a sequence of instantaneous ones (there as well)",
}


@guarded
def cite(as_json: Json = False) -> None:
    """Say how to cite Carom and what it is built on.

    Example: carom cite
    """
    import carom

    version = carom.__version__
    bibtex = (
        "@software{carom,\n"
        "  title   = {Carom: nonsmooth contact dynamics of frictional spheres},\n"
        "  author  = {{The Carom developers}},\n"
        f"  version = {{{version}}},\n"
        "}"
    )
    if as_json:
        emit({"version": version, "bibtex": bibtex, "sources": SOURCES})
        return
    print(f"Please cite Carom with its version, and the paper whose method it implements:\n\n{bibtex}\n")
    for source in SOURCES.values():
        print(f"  {source}")
