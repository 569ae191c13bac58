#!/bin/sh
# Makes .venv where it is missing or broken and installs named requirements into it at the versions of constraints.txt.
#
#   tools/setup.sh STAMP NAME...         NAME as in tools/requirements.py; STAMP is touched at the end

set -eu
cd "$(dirname "$0")/.."
stamp=$1
shift

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
.venv/bin/python tools/requirements.py "$@" >"$wanted"
echo "installing into .venv: $*"
if ! .venv/bin/python -m pip install --quiet --no-input --disable-pip-version-check --prefer-binary \
    -c constraints.txt -r "$wanted" </dev/null; then
    rm -f "$wanted"
    echo "carom: installing '$*' failed. Cure: see pip's message above; the first call needs the network" >&2
    exit 2
fi
rm -f "$wanted"
: >"$stamp"
