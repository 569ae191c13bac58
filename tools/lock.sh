#!/usr/bin/env bash
# Writes constraints.txt anew: the newest versions that go together for every extra and every group at once.

set -euo pipefail
cd "$(dirname "$0")/.."
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
"$(tools/preflight.sh --python)" -m venv "$dir/venv"
"$dir/venv/bin/python" -m pip install --quiet --upgrade pip # --report needs a recent one
"$dir/venv/bin/python" tools/requirements.py --all >"$dir/wanted.txt"
"$dir/venv/bin/python" -m pip install --quiet --dry-run --ignore-installed --only-binary :all: \
    --report "$dir/report.json" -r "$dir/wanted.txt"
"$dir/venv/bin/python" - "$dir/report.json" >"$dir/constraints.txt" <<'PY'
import json
import re
import sys

found = [entry["metadata"] for entry in json.load(open(sys.argv[1], encoding="utf-8"))["install"]]
print("# Exact versions of everything that any target of the Makefile or any extra installs; `make lock` writes this file.")
for name, version in sorted((re.sub(r"[-_.]+", "-", m["name"].lower()), m["version"]) for m in found):
    print(f"{name}=={version}")
PY
mv "$dir/constraints.txt" constraints.txt
