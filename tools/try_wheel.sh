#!/usr/bin/env bash
# Installs the wheel into an empty virtual environment, away from the sources, and asks it for its version.

set -euo pipefail
cd "$(dirname "$0")/.."
wheel=$(realpath "$1")
constraints=$(realpath constraints.txt)
python=$(realpath .venv/bin)/python

dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
"$python" -m venv empty
empty/bin/python -m pip install --quiet --no-input --disable-pip-version-check -c "$constraints" "$wheel" </dev/null
version=$(empty/bin/carom --version)
echo "installed in an empty environment: $version"
empty/bin/carom examples copy three_balls >/dev/null
empty/bin/carom run three_balls.toml
