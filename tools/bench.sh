#!/usr/bin/env bash
# Every script of benches/, each with a table of its own; benches/run.py runs those of crates/*/benches too.

set -euo pipefail
cd "$(dirname "$0")/.."

# Compiled before anything is timed, and loudly.
cargo bench --workspace --bench '*' --no-run
for script in benches/[!_]*.py; do
    .venv/bin/python "$script" "$@"
    echo
done
