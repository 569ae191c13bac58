#!/usr/bin/env bash
# Every benchmark there is: crates/*/benches by cargo, then each script of benches/ (its own table each).

set -euo pipefail
cd "$(dirname "$0")/.."

if compgen -G 'crates/*/benches/*.rs' >/dev/null; then
    cargo bench --workspace --bench '*'
fi
ran=0
for script in benches/[!_]*.py; do
    [ -e "$script" ] || continue
    echo "--- $script"
    .venv/bin/python "$script" "$@"
    ran=1
done
[ $ran -eq 1 ] || echo "benches/ holds no script yet"
