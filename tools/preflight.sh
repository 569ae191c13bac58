#!/bin/sh
# Says in one line what this machine lacks, with the cure, before anything is built; exit code 2.
#
#   tools/preflight.sh rust python       what is to be looked at: rust, rust-tests, rustfmt, python
#   tools/preflight.sh --python          print the interpreter that a new .venv would be made from
#
# The extension needs no Python headers (its bindings carry their own declarations), so none are asked for.

cd "$(dirname "$0")/.." || exit 2

lacking= packages= advice=

# lacks WHAT [PACKAGES OF DEBIAN [ADVICE]]
lacks() {
    lacking="$lacking${lacking:+; }$1"
    packages="$packages${2:+ $2}"
    [ -z "$3" ] || advice="$advice${advice:+; }$3"
}

report() {
    [ -n "$lacking" ] || return 0
    cure=${packages:+"apt-get install$packages"}
    printf 'carom: %s. Cure: %s\n' "$lacking" "$cure${cure:+${advice:+; }}$advice" >&2
    exit 2
}

runs_311() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

find_python() {
    if [ -n "$PYTHON" ]; then
        python=$PYTHON
        runs_311 "$python" && return
        lacks "PYTHON=$PYTHON does not run Python 3.11 or newer" "" "name another interpreter, or none"
        return 1
    fi
    for python in python3 python3.14 python3.13 python3.12 python3.11 python3.15; do
        command -v "$python" >/dev/null 2>&1 && runs_311 "$python" && return
    done
    if command -v python3 >/dev/null 2>&1; then
        lacks "Python 3.11 or newer is needed, found $(python3 --version 2>&1)" "" \
            "use Debian 12 or newer, or make PYTHON=/path/to/python3.11"
    else
        lacks "Python 3.11 or newer is needed, found none" "python3 python3-venv"
    fi
    return 1
}

check_python() {
    # A virtual environment that works already answers every question below.
    if runs_311 .venv/bin/python && .venv/bin/python -c 'import pip' >/dev/null 2>&1; then return; fi
    find_python || return
    "$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
        lacks "$python cannot make a virtual environment (no module ensurepip)" "python3-venv"
}

check_linker() {
    cc=${CC:-cc}
    if ! command -v "$cc" >/dev/null 2>&1; then
        lacks "no C linker ($cc), which Rust needs" "gcc libc6-dev"
        return
    fi
    dir=$(mktemp -d) || return
    trap 'rm -rf "$dir"' EXIT
    echo 'int main(void) { return 0; }' >"$dir/main.c"
    "$cc" -o "$dir/main" "$dir/main.c" >/dev/null 2>&1 || lacks "$cc cannot link a program" "gcc libc6-dev"
}

check_rust() {
    need=${1:-$(sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml)}
    install="install Rust from https://rustup.rs (Debian 13 or newer: apt-get install cargo)"
    if ! command -v cargo >/dev/null 2>&1; then
        if [ -x "$HOME/.cargo/bin/cargo" ]; then
            lacks "cargo is not on the PATH" "" ". \"\$HOME/.cargo/env\""
        else
            lacks "cargo is missing (Rust $need or newer is needed)" "" "$install"
        fi
        return
    fi
    have=$(rustc --version 2>/dev/null | sed -n 's/^rustc \([0-9]*\.[0-9]*\).*/\1/p')
    if [ -z "$have" ]; then
        command -v rustup >/dev/null 2>&1 && install="rustup default stable"
        lacks "rustc does not run" "" "$install"
        return
    fi
    oldest=$(printf '%s\n%s\n' "$need" "$have" | sort -t. -k1,1n -k2,2n | head -n 1)
    [ "$oldest" = "$need" ] && return
    command -v rustup >/dev/null 2>&1 && install="rustup update stable"
    lacks "Rust $need or newer is needed, found $have" "" "$install"
}

check_rustfmt() {
    command -v cargo >/dev/null 2>&1 || return # said already
    cargo fmt --version >/dev/null 2>&1 ||
        lacks "rustfmt is missing" "" "rustup component add rustfmt (or apt-get install rustfmt)"
    cargo clippy --version >/dev/null 2>&1 ||
        lacks "clippy is missing" "" "rustup component add clippy (or apt-get install rust-clippy)"
}

for what in "$@"; do
    case $what in
    rust) check_rust; check_linker ;;
    rust-tests) check_rust 1.88; check_linker ;; # proptest asks for more than Carom itself
    rustfmt) check_rustfmt ;;
    python) check_python ;;
    --python) find_python && printf '%s\n' "$python" ;;
    *) lacks "tools/preflight.sh does not know '$what'" "" "rust, rust-tests, rustfmt, python or --python" ;;
    esac
done
report
