"""Sphinx: the pages of docs/ as they are, in one theme. `make docs` treats warnings as errors.

Pages of docs/gallery, some guides and docs/tutorial.md are notebooks in Markdown (MyST-NB): their code runs when the
documentation is built, and again only when it has changed (docs/_build/.jupyter_cache). tests/test_docs.py runs it
without Sphinx.
"""

import logging
import os
import re
import tomllib
from pathlib import Path

from docutils import nodes
from nbclient import NotebookClient
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

ROOT = Path(__file__).parent.parent

project = "Carom"
author = "The Carom developers"
copyright = "the Carom developers, Apache License 2.0"
release = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
exclude_patterns = ["_build", "_static"]
suppress_warnings = ["mystnb.unknown_mime_type"]
html_theme = "furo"
html_title = f"Carom {release}"
html_static_path = ["_static"]
html_css_files = ["carom.css"]
html_search_scorer = str(Path(__file__).parent / "_static" / "search_scorer.js")

myst_heading_anchors = 3
myst_ref_domains = ["std"]  # #parameters is a heading, not an attribute of the API reference
nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parent / "_build" / ".jupyter_cache")
nb_execution_in_temp = True  # runs and pictures that a page writes do not lie between its sources
nb_execution_timeout = 120  # s for a cell
nb_execution_raise_on_error = True
nb_merge_streams = True

# What a page runs sees the figures' style, this environment's `carom`, and no terminal.
os.environ["MATPLOTLIBRC"] = str(Path(__file__).parent / "matplotlibrc")
os.environ["PATH"] = f"{ROOT / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
os.environ["NO_COLOR"] = "1"

logging.getLogger("traitlets").setLevel(logging.WARNING)  # one line for each page that runs
# Each kernel would warn that others on this machine could listen to it. The list is the default of every client.
NotebookClient.extra_arguments.default_args = (["--log-level=ERROR"],)

# The API reference comes from docstrings. They are plain prose with `code` in single back quotes.
default_role = "code"
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "inherited-members": False}
autosummary_generate = False


def _plain_bars(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """|v| in a docstring is a norm, and no substitution of reStructuredText."""
    for k, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        lines[k] = "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in parts)


GALLERY = "gallery/index"


def _pictures(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """The first picture that each page of the gallery draws, before the table of its index."""
    if page != GALLERY:
        return
    grid = nodes.container(classes=["carom-gallery"])
    for name in app.env.toctree_includes[GALLERY]:
        picture = next(iter(app.env.get_doctree(name).findall(nodes.image)))
        title = app.env.titles[name].astext()
        link = nodes.reference("", "", refuri=app.builder.get_relative_uri(GALLERY, name), internal=True)
        small = picture.deepcopy()
        small["alt"] = title
        link += [small, nodes.Text(title)]
        grid += nodes.paragraph("", "", link)
    table = next(iter(doctree.findall(nodes.table)))
    table.parent.insert(table.parent.index(table), grid)


def _pages_to_write(app: Sphinx, env: BuildEnvironment) -> list[str]:
    return [GALLERY]  # pictures of other pages may have changed


def setup(app: Sphinx) -> None:
    app.connect("doctree-resolved", _pictures)
    app.connect("env-updated", _pages_to_write)
    app.connect("autodoc-process-docstring", _plain_bars)
