#!/bin/sh
# Create a virtual environment: .ci/venv.sh DIRECTORY
# Uses $PYTHON, or else the first Python of at least 3.11 that runs. Says in words what is missing.
set -eu

directory=$1

recent_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

chosen=
if [ -n "${PYTHON:-}" ]; then
    if ! recent_enough "$PYTHON"; then
        echo "gibiane: PYTHON=$PYTHON does not run, or is older than Python 3.11" >&2
        exit 1
    fi
    chosen=$PYTHON
else
    for candidate in python3.13 python3.12 python3.11 python3 python; do
        if recent_enough "$candidate"; then
            chosen=$candidate
            break
        fi
    done
fi
if [ -z "$chosen" ]; then
    echo "gibiane: no Python of at least 3.11 was found" >&2
    echo "  install one (Debian, Ubuntu: apt-get install python3 python3-venv), or name it: make PYTHON=/path/to/python3" >&2
    exit 1
fi

if ! "$chosen" -c 'import venv, ensurepip' >/dev/null 2>&1; then
    version=$("$chosen" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    echo "gibiane: $chosen cannot make a virtual environment: its module ensurepip is missing" >&2
    echo "  on Debian or Ubuntu: apt-get install python3-venv   (or python$version-venv), then run make again" >&2
    exit 1
fi

echo "gibiane: making a virtual environment in $directory with $("$chosen" --version)"
"$chosen" -m venv --clear "$directory"
