"""Other codes on the two blocks: time, unknowns, and distance from the exact contact solution of the same mesh.

usage: measure.py FILE.csv CASE...      CASE: T1_2 (see blocks.py), friction coefficient 0.2; T1F_2: without friction

Runs what is installed (CalculiX, GetFEM with the system's Python, scikit-fem with this one), says what is not, and adds one
row a run to FILE.csv; a row of the same code, version, case and friction coefficient is kept. Run it with the Python that runs Gibiane: the
exact solution of each mesh is Gibiane's own, whose energy and the energy of the difference are taken with `blocks.stiffness`.
Columns: scene (ENTIER: 1 for T1), n, code (its number in CODES, from 1), seconds (mesh, matrix and solution; of CalculiX
the whole process), ndof, energy (stress by strain, integrated, exact solution), gap (energy norm of the difference), mu,
year, month, day, runs; the versions stand in FILE.csv.txt, a line a code."""

import csv
import datetime
import importlib.util
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from blocks import case, joined, stiffness

HERE = Path(__file__).parent
MU = 0.2
PATIENCE = 400.0
"""Seconds after which a code is stopped; none that finished took half of it."""
CODES = ("CalculiX N2S", "CalculiX S2S", "GetFEM integral", "scikit-fem tied")
COLUMNS = ("scene", "n", "code", "seconds", "ndof", "energy", "gap", "mu", "year", "month", "day", "runs")
SCRIPT = """OPTI DIME 3 ELEM CUB8 ;
B = (DROI {nl} (-100. -100. -200.) (100. -100. -200.)) TRAN {nl} (0. 200. 0.) ; V1 = B VOLU {nl} 'TRAN' (0. 0. 200.) ;
T = (DROI {nu} (-{a} -{a} 0.) ({a} -{a} 0.)) TRAN {nu} (0. {H} 0.) ; V2 = T VOLU {nu} 'TRAN' (0. 0. {H}) ;
V = V1 ET V2 ; MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 210000. 'NU' 0.3 ;
K = (RIGI MO MA) ET (BLOQ 'DEPL' B) ; F = PRES 'MASS' MO 3.125 (FACE 2 V2) ;
MC = MODE (FACE 2 V1) (FACE 1 V2) 'CONTACT' 'FROTTANT' 'COULOMB' ;
KC JC = RIGI MC (MATE MC 'MU' {mu}) ; U = EXCO (MOTS 'UX' 'UY' 'UZ') (RESO (K ET KC) (F ET JC)) ;
LX = MOTS 'X' 'Y' 'Z' ; LU = MOTS 'UX' 'UY' 'UZ' ; L = TABL ;
REPE B 2 ;
  SI (&B EGA 1) ; VB = V1 ; SINON ; VB = V2 ; FINSI ;
  L. &B = TABL ;
  REPE BC 3 ;
    L. &B . &BC = EXTR (COOR &BC VB) 'VALE' ; L. &B .(3 + &BC) = EXTR (EXCO (EXTR LU &BC) (REDU U VB) 'SCAL') 'VALE' ;
  FIN BC ;
FIN B ;
"""


def codes():
    """Return {code: (version, command)} of what is installed; the command without case and file of nodes."""
    found = {}
    if shutil.which("ccx"):
        text = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout
        version = re.search(r"[Vv]ersion\s+(\S+)", text)
        for kind in ("N2S", "S2S"):
            found[f"CalculiX {kind}"] = (version.group(1) if version else "?", [sys.executable, "ccx_contact.py"])
    system = shutil.which("python3", path="/usr/bin:/usr/local/bin")
    if system:
        line = "import getfem, importlib.metadata as m; print(getfem.__version__ if hasattr(getfem, '__version__') else '')"
        done = subprocess.run([system, "-c", line], capture_output=True, text=True, env={})
        if done.returncode == 0:
            version = done.stdout.strip() or _debian("python3-getfem")
            found["GetFEM integral"] = (version, [system, "getfem_contact.py"])
    if importlib.util.find_spec("skfem"):
        import skfem

        found["scikit-fem tied"] = (skfem.__version__, [sys.executable, "skfem_tied.py"])
    return found


def _debian(package):
    if not shutil.which("dpkg-query"):
        return "?"
    done = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", package], capture_output=True, text=True)
    return done.stdout.strip() or "?"


def exact(c, mu):
    """Return the nodes of both blocks and Gibiane's contact solution: points, upper, u."""
    from gibiane.session import Session

    out = io.StringIO()
    session = Session(out=out, err=out)
    script = SCRIPT.format(nl=c["nl"], nu=c["nu"], a=c["a"], H=c["H"], mu=mu)
    if session.run_text(script) != 0:
        raise SystemExit(out.getvalue())
    lists = session.globals.names["L"]
    blocks = [np.array([lists.get(b).get(i).values for i in range(1, 7)]).T for b in (1, 2)]
    upper = np.repeat([False, True], [len(block) for block in blocks])
    whole = np.vstack(blocks)
    return whole[:, :3], upper, whole[:, 3:]


def in_order(points, upper, u, xyz, top):
    """Return u in the order of the nodes (xyz, top)."""

    def keys(x, above):
        return [tuple(row) for row in np.c_[np.round(x * 1e3).astype(int), above.astype(int)].tolist()]

    number = {key: i for i, key in enumerate(keys(points, upper))}
    return u[[number[key] for key in keys(xyz, top)]]


def measure(c, mu, code, command, folder):
    """Run a code once; return (seconds, unknowns, nodes, message); nodes None when it failed."""
    nodes = folder / "nodes.npz"
    nodes.unlink(missing_ok=True)
    arguments = {
        "CalculiX N2S": [str(folder), c["name"], str(mu), "N2S"],
        "CalculiX S2S": [str(folder), c["name"], str(mu), "S2S"],
        "GetFEM integral": [c["name"], str(mu), "gwfl"],
        "scikit-fem tied": [c["name"]],
    }[code]
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [*command, *arguments, f"--nodes={nodes}"],
            cwd=HERE, env=environment, capture_output=True, text=True, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return PATIENCE, 0, None, f"not finished after {PATIENCE:.0f} s"
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        return 0.0, 0, None, (done.stderr.strip().splitlines() or ["no result"])[-1]
    result = json.loads(lines[-1])
    if not result.get("finished", True) or not result.get("converged", True) or not nodes.is_file():
        return 0.0, 0, None, "did not converge"
    seconds = result["wall"] - result.get("t_import", 0.0)
    with np.load(nodes) as kept:
        found = kept["points"], kept["upper"], kept["u"]
    return seconds, result.get("ndof", 3 * len(found[0])), found, ""


def main(file, cases):
    """Measure what is missing in the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    if file.is_file():
        with file.open(encoding="utf-8", newline="") as lines:
            rows = list(csv.DictReader(lines, delimiter=";"))
    found = codes()
    for code in CODES:
        print(f"{code}: {'version ' + found[code][0] if code in found else 'not installed, left out'}")
    versions = file.with_suffix(".csv.txt")
    before = versions.read_text(encoding="utf-8").splitlines() if versions.is_file() else []
    now = [f"{code} {found[code][0]}" if code in found else f"{code} not installed" for code in CODES]
    kept = {i + 1 for i, line in enumerate(now) if line in before}
    rows = [row for row in rows if int(row["code"]) in kept and np.isfinite(float(row["gap"]))]
    done = {(row["scene"], row["n"], row["code"], float(row["mu"])) for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        for name in cases:
            mu = 0.0 if "F" in name else MU
            c = case(name.replace("F", ""))
            scene, n = c["name"][1:].split("_")
            missing = [code for code in found if (scene, n, str(CODES.index(code) + 1), mu) not in done]
            if not missing:
                continue
            points, upper, u = exact(c, mu)
            xyz, cl, cu, pairs, _, _ = joined(c, False)
            top = np.arange(len(xyz)) >= len(c["lower"][0])
            K = stiffness(c, xyz, cl, cu)
            u0 = in_order(points, upper, u, xyz, top).ravel()
            for code in missing:
                seconds, ndof, nodes, message = measure(c, mu, code, found[code][1], Path(folder))
                if nodes is None:
                    print(f"{name} {code}: {message}")
                    continue
                d = in_order(*nodes, xyz, top).ravel() - u0
                if not np.isfinite(d).all():
                    print(f"{name} {code}: displacements that are no numbers")
                    continue
                # rounding makes the energy of nearly equal solutions negative
                gap = np.sqrt(max(d @ (K @ d), 0.0))
                today = datetime.date.today()
                values = (scene, n, CODES.index(code) + 1, f"{seconds:.4f}", ndof, f"{u0 @ (K @ u0):.12g}",
                          f"{gap:.8g}", mu, today.year, today.month, today.day, 1)  # fmt: skip
                rows.append(dict(zip(COLUMNS, map(str, values), strict=True)))
                print(f"{name} {code}: {seconds:.2f} s")
                write(file, rows)
                versions.write_text("\n".join(now) + "\n", encoding="utf-8")
    if rows:
        write(file, rows)
        versions.write_text("\n".join(now) + "\n", encoding="utf-8")


def write(file, rows):
    """Write the file whole, or leave it as it was."""
    part = file.with_suffix(".part")
    with part.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, COLUMNS, delimiter=";")
        writer.writeheader()
        writer.writerows(rows)
    part.replace(file)


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute(), sys.argv[2:])
