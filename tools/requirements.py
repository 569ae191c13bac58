"""Print the requirements stated in pyproject.toml, one a line.

    python tools/requirements.py base plot test   # the package's own, the extra [plot], the group test
    python tools/requirements.py --all

Installing the package to get its dependencies would compile it first; this reads the same lines without.
"""

import sys
import tomllib
from pathlib import Path


def main(names: list[str]) -> int:
    pyproject = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))
    parts = {
        "base": pyproject["project"]["dependencies"],
        **pyproject["project"]["optional-dependencies"],
        **pyproject["dependency-groups"],
    }
    for name in parts if names == ["--all"] else names:
        if name not in parts:
            print(f"{name}: not among {', '.join(parts)}", file=sys.stderr)
            return 2
        print("\n".join(parts[name]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
