#!/usr/bin/env bash
# Installs each distribution (wheel or sources) into an empty virtual environment, away from the sources, and uses it there:
#   tools/try_wheel.sh dist/*.whl dist/*.tar.gz

set -euo pipefail
cd "$(dirname "$0")/.."
constraints=$(realpath constraints.txt)
python=$(realpath .venv/bin)/python
distributions=()
for file in "$@"; do distributions+=("$(realpath "$file")"); done

dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for file in "${distributions[@]}"; do
    echo "--- $(basename "$file")"
    rm -rf empty away
    mkdir away
    "$python" -m venv empty
    empty/bin/python -m pip install --quiet --no-input --disable-pip-version-check -c "$constraints" "$file" </dev/null
    (
        cd away # no file of the sources is found from here
        ../empty/bin/carom --version
        ../empty/bin/carom doctor
        ../empty/bin/carom demo --no-plots --quiet
        ../empty/bin/carom examples copy three_balls >/dev/null
        ../empty/bin/carom run three_balls.toml
        ../empty/bin/carom check runs/three_balls-1
    ) </dev/null
    echo "installed in an empty environment and used: $(basename "$file")"
done
