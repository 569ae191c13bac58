#!/usr/bin/env bash
# Coverage-guided fuzzing of the crates, on stable Rust: see fuzz/README.md.
#
#   tools/fuzz.sh [SECONDS [TARGET ...]]     each target for so long (60), from the kept corpora; fails where something is found
#   tools/fuzz.sh --keep [TARGET ...]        makes the kept corpora anew: the smallest inputs that reach all that was reached

set -uo pipefail
cd "$(dirname "$0")/.."
targets=(scene state solve neighbours walls expression)
keep=
if [ "${1-}" = --keep ]; then
    keep=1
    shift
else
    seconds=${1:-60}
    [ $# -eq 0 ] || shift
    case $seconds in '' | *[!0-9]*) echo "carom: $seconds is no number of seconds; make fuzz ARGS=\"60 scene\"" >&2 && exit 2 ;; esac
fi
[ $# -eq 0 ] || targets=("$@")
command -v "${CXX:-c++}" >/dev/null 2>&1 || { echo "carom: libFuzzer needs a C++ compiler. Cure: apt-get install g++" >&2; exit 2; }

# Coverage that libFuzzer reads, by LLVM's pass, which stable Rust has; no sanitizer, since no crate of ours has unsafe code.
export RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares"
# With --target the flags are not those of build scripts and macros.
host=$(rustc -vV | sed -n 's/^host: //p')
bins=()
for target in "${targets[@]}"; do bins+=(--bin "$target"); done
cargo build --manifest-path fuzz/Cargo.toml --target-dir target/fuzz --release --locked --target "$host" "${bins[@]}" || exit 1

# A step may take a million substeps, or every fallback: minutes in an instrumented build on a busy machine. Memory in MB.
limits=(-timeout=400 -rss_limit_mb=2048 -max_len=1024 -len_control=0)
failed=()
for target in "${targets[@]}"; do
    program=target/fuzz/$host/release/$target work=.make/fuzz/$target found=.make/fuzz/findings/$target
    mkdir -p "$work" "$found" "fuzz/corpus/$target"
    if [ -n "$keep" ]; then
        small=.make/fuzz/smallest && rm -rf "$small" && mkdir -p "$small"
        # Inputs with a name that says what they were stay; others go where smaller ones do the same.
        find "fuzz/corpus/$target" -type f -regex '.*/[0-9a-f]+' -exec mv -t "$work" {} +
        "$program" -set_cover_merge=1 -use_counters=0 "${limits[@]}" "$small" "fuzz/corpus/$target" "$work" >.make/fuzz/merge.log 2>&1 || failed+=("$target")
        find "$small" -type f -regex '.*/[0-9a-f]+' -exec cp -n -t "fuzz/corpus/$target" {} +
        echo "$target: $(find "fuzz/corpus/$target" -type f | wc -l) inputs, $(du -sb "fuzz/corpus/$target" | cut -f1) bytes"
        continue
    fi
    echo "--- $target, $seconds s"
    log=.make/fuzz/$target.log
    findings=0
    "$program" "${limits[@]}" -max_total_time="$seconds" -print_final_stats=1 -artifact_prefix="$found/" "$work" "fuzz/corpus/$target" \
        >"$log" 2>&1 || { failed+=("$target"); findings=1; } # libFuzzer ends with the first
    grep -aE -A1 "panicked at|ERROR: libFuzzer|Test unit written" "$log"
    echo "$target: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") executions, $findings findings"
done
if [ ${#failed[@]} -gt 0 ]; then
    echo "fuzzing found something: ${failed[*]}; the inputs are in .make/fuzz/findings"
    exit 1
fi
