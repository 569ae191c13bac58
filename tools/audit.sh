#!/usr/bin/env bash
# What Carom is built of: pins, licences, duplicates and sources of crates and packages, and known vulnerabilities of them.
#
#   tools/audit.sh            what needs no network
#   tools/audit.sh --online   known vulnerabilities too
#
# The last lines say what was judged and what was not. A tool that is not installed is skipped: cargo install --locked cargo-deny;
# pipx install pip-audit. What the tests of the supply judge without them: tests/test_supply.py.

set -uo pipefail
cd "$(dirname "$0")/.."
failed=() skipped=() judged=()

step() {
    local name=$1
    shift
    echo "--- $name"
    judged+=("$name")
    "$@" || failed+=("$name")
}

if .venv/bin/python -c 'import pytest' 2>/dev/null; then
    step "lock files, hashes, licences of crates, unsafe code, imports" .venv/bin/python -m pytest -q -p no:cacheprovider tests/test_supply.py
else
    skipped+=("lock files, hashes, licences of crates, unsafe code, imports (make dev)")
fi

crates=(bans licenses sources)
[ "${1-}" = --online ] && crates+=(advisories)
if cargo deny --version >/dev/null 2>&1; then
    step "cargo deny (${crates[*]})" cargo deny --locked check --hide-inclusion-graph "${crates[@]}"
else
    skipped+=("cargo deny")
fi

if [ "${1-}" != --online ]; then
    skipped+=("known vulnerabilities (--online)")
elif command -v pip-audit >/dev/null 2>&1; then
    # constraints.txt names every package with its version, so that nothing is to be resolved.
    step "pip-audit" pip-audit --requirement constraints.txt --no-deps --disable-pip --progress-spinner off
else
    skipped+=("pip-audit")
fi

for name in "${judged[@]}"; do echo "audit judged: $name"; done
for name in "${skipped[@]}"; do echo "audit skipped: $name"; done
if [ ${#failed[@]} -gt 0 ]; then
    printf 'audit failed: %s\n' "$(IFS=, && echo "${failed[*]}")"
    exit 1
fi
