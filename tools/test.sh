#!/usr/bin/env bash
# Both test suites, each to its end, closing with the runners' own summary lines.
#
#   tools/test.sh smoke|quick|all [argument of pytest ...]

set -uo pipefail
cd "$(dirname "$0")/.."
tier=$1
shift

mkdir -p .make
cargo_log=.make/cargo-test.log pytest_log=.make/pytest.log
locked=${CI:+--locked}
rust_targets=() rust_args=() python_args=()
if [ "$tier" = all ]; then
    rust_args=(--include-ignored)
    python_args=(-m "")
elif [ "$tier" = smoke ]; then
    mapfile -t python_args < <(grep '^[^#]*/' tools/smoke.txt)
    rust_targets=(--lib)
    while read -r name; do rust_targets+=(--test "$name"); done < <(grep -v '[#/]' tools/smoke.txt)
fi

# Compiled loudly, run quietly. Every crate is selected, as in the build of the extension: the features are then the same
# and nothing compiles twice (carom-py itself has nothing to test and is not linked).
cargo test --release --workspace $locked "${rust_targets[@]}" --no-run || exit 1
cargo test --release --workspace $locked "${rust_targets[@]}" --quiet --no-fail-fast -- "${rust_args[@]}" 2>&1 | tee "$cargo_log"
cargo_status=$?

# By files: what the tests of a file share is made once.
.venv/bin/python -m pytest -n "${PYTEST_JOBS:-2}" --dist loadfile -q "${python_args[@]}" "$@" 2>&1 | tee "$pytest_log"
pytest_status=$?

echo
echo "cargo test:"
grep -E '^test result: ' "$cargo_log" | grep -vE ' 0 passed; 0 failed; 0 ignored;' || echo "no Rust test ran"
echo "pytest:"
grep -aE ' in [0-9.]+s' "$pytest_log" | tail -n 1
[ $cargo_status -eq 0 ] && [ $pytest_status -eq 0 ]
