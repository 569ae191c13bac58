#!/usr/bin/env bash
# Formatting, lints, types and what Carom is built of, all of it even where one fails.

set -uo pipefail
cd "$(dirname "$0")/.."
python=.venv/bin/python
locked=${CI:+--locked}
failed=()

step() {
    local name=$1
    shift
    echo "--- $name"
    "$@" || failed+=("$name")
}

# Clippy works in the profile dev: in release, its environment and that of maturin would undo each other's bindings.
export PYO3_PYTHON="$PWD/$python"
step "rustfmt" cargo fmt --all --check
step "clippy" cargo clippy --workspace --all-targets $locked --quiet -- -D warnings
step "ruff check" "$python" -m ruff check --no-cache
step "ruff format" "$python" -m ruff format --check
step "layers" env PYTHONPATH=python .venv/bin/lint-imports --no-cache --no-logo
step "circles" "$python" tools/circles.py
step "prose" "$python" tools/prose.py
step "mypy" "$python" -m mypy
step "stub" env PYTHONPATH=python "$python" -m mypy.stubtest carom._core --allowlist tools/stubtest.txt --concise
step "audit" tools/audit.sh

if [ ${#failed[@]} -gt 0 ]; then
    printf 'check failed: %s\n' "$(IFS=, && echo "${failed[*]}")"
    exit 1
fi
echo "check passed: rustfmt, clippy, ruff, layers, circles, prose, mypy, stub, audit"
