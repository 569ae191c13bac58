"""Sphinx: the pages of docs/ as they are, in one theme. `make docs` treats warnings as errors."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent

project = "Carom"
author = "The Carom developers"
copyright = "the Carom developers, Apache License 2.0"
release = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]

extensions = ["myst_parser"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"Carom {release}"
