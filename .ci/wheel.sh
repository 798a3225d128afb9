#!/bin/sh
# Build the wheel, unpack it elsewhere, and use what is in it: a script, a shipped procedure, a notice.
# Usage: wheel.sh VENV (whose packages serve; the clone itself is not on the path)
set -eu
python=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")/bin/python
clone=$(pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
"$python" -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$place" .
"$python" -m zipfile -e "$place"/*.whl "$place/unpacked"
cp -r examples/premiers_pas "$place/scene"
cd "$place/scene"
export PYTHONPATH="$place/unpacked"
"$python" -c "import gibiane, gibiane_ops, sys; sys.exit(any(not m.__file__.startswith('$place') for m in (gibiane, gibiane_ops)))"
"$python" -m gibiane scene.dgibi
"$python" -m gibiane info ADAPTER >notice.txt
grep -q "Adapt a mesh" notice.txt
for data in gibiane/grammar.json gibiane/py.typed gibiane_ops/py.typed gibiane_ops/kernels/report/page/view.js; do
    [ -f "$place/unpacked/$data" ] || { echo "wheel: $data is missing" >&2; exit 1; }
done
shipped=$(find "$place/unpacked/gibiane/scripts" -name '*.procedur' | wc -l)
written=$(find "$clone/scripts" -name '*.procedur' | wc -l)
[ "$shipped" -eq "$written" ] || { echo "wheel: $shipped procedures of $written" >&2; exit 1; }
echo "wheel: works outside of the clone, with $shipped procedures"
