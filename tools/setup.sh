#!/bin/sh
# Makes .venv where it is missing or broken and installs named requirements into it at the versions of constraints.txt.
#
#   tools/setup.sh STAMP NAME...              NAME as in tools/requirements.py; STAMP is touched at the end
#   tools/setup.sh STAMP --optional NAME...   what cannot be installed is named and left out; STAMP is then not touched,
#                                             so that the next call tries again

set -eu
cd "$(dirname "$0")/.."
stamp=$1
shift
optional=
if [ "$1" = --optional ]; then
    optional=1
    shift
fi

# Two calls of make at once must not install into each other.
mkdir -p .make
if command -v flock >/dev/null 2>&1; then
    exec 9>.make/lock
    flock 9
fi

if ! .venv/bin/python -c 'import pip' >/dev/null 2>&1; then
    python=$(tools/preflight.sh --python)
    echo "making .venv with $("$python" --version)"
    "$python" -m venv --clear .venv
fi

mkdir -p .venv/.carom
wanted=.venv/.carom/wanted-$$.txt
trap 'rm -f "$wanted"' EXIT
install() {
    .venv/bin/python tools/requirements.py "$@" >"$wanted"
    .venv/bin/python -m pip install --quiet --no-input --disable-pip-version-check --prefer-binary \
        ${optional:+--retries 1} -c constraints.txt -r "$wanted" </dev/null
}

echo "installing into .venv: $*"
if [ -z "$optional" ]; then
    if ! install "$@"; then
        echo "carom: installing '$*' failed. Cure: see pip's message above; the first call needs the network" >&2
        exit 2
    fi
elif ! install "$@" 2>/dev/null; then
    lacking=
    for name in "$@"; do
        install "$name" 2>.make/lacking-"$name".log || lacking="$lacking $name"
    done
    if [ -n "$lacking" ]; then
        echo "carom: not installed here:$lacking (pip's reasons: .make/lacking-*.log). Their tests are skipped" >&2
        exit 0
    fi
fi
: >"$stamp"
