#!/usr/bin/env bash
# What Carom is built of: licences, duplicates and sources of the crates, and known vulnerabilities of crates and packages.
#
#   tools/audit.sh            what needs no network
#   tools/audit.sh --online   known vulnerabilities too
#
# A tool that is not installed is skipped, and the last line says so: cargo install --locked cargo-deny; pipx install pip-audit.

set -uo pipefail
cd "$(dirname "$0")/.."
failed=() skipped=()

step() {
    local name=$1
    shift
    echo "--- $name"
    "$@" || failed+=("$name")
}

crates=(bans licenses sources)
[ "${1-}" = --online ] && crates+=(advisories)
if cargo deny --version >/dev/null 2>&1; then
    step "cargo deny" cargo deny --locked check --hide-inclusion-graph "${crates[@]}"
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

[ ${#skipped[@]} -eq 0 ] || printf 'audit skipped: %s\n' "$(IFS=, && echo "${skipped[*]}")"
if [ ${#failed[@]} -gt 0 ]; then
    printf 'audit failed: %s\n' "$(IFS=, && echo "${failed[*]}")"
    exit 1
fi
