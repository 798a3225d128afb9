"""The indentation scene against published-method prototypes and independent solutions.

The percentages are those of two prototypes of the same definitions (nodal mean smoothing, the thesis's norm, contact
part by densities), to 0.01: global error of the exact Coulomb solution and of the fixed point of statuses. The
displacements and forces are those of an independent node-to-node solution (tests/data/two_blocks.json).
"""

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from gibiane import Session

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "examples" / "poinconnement" / "scene.dgibi"
ORACLES = json.loads((ROOT / "tests" / "data" / "two_blocks.json").read_text(encoding="utf-8"))
MU = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
# global error in %, for n = 1, 2, 3, 4, friction coefficients in the order of MU
EXACT = {
    1: (8.83, 8.82, 8.82, 8.83, 8.90, 8.90, 8.91),
    2: (6.06, 6.04, 6.04, 6.13, 6.17, 6.25, 6.26),
    3: (4.78, 4.75, 4.74, 4.82, 4.96, 5.05, 5.07),
    4: (4.00, 3.98, 3.98, 4.08, 4.24, 4.33, 4.36),
}
STATUSES = {
    1: (8.83, 8.82, 8.82, 8.83, 8.90, 8.90, 8.91),
    2: (6.09, 6.18, 6.27, 6.45, 6.60, 6.38, 6.26),
    3: (4.81, 4.87, 4.97, 5.33, 5.58, 5.34, 5.09),
    4: (4.03, 4.10, 4.21, 4.55, 4.94, 4.78, 4.40),
}
CONTACT_EXACT = {
    1: (0.63, 1.31, 1.69, 1.87, 1.51, 0.48, 0.0),
    2: (0.48, 1.02, 1.32, 1.40, 1.17, 0.67, 0.0),
    3: (0.30, 0.62, 0.79, 0.87, 0.84, 0.76, 0.16),
    4: (0.23, 0.48, 0.61, 0.69, 0.67, 0.72, 0.21),
}


def run_scene(n: int) -> dict[tuple[float, str], list[float]]:
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names["N"] = n
    assert session.run_file(SCENE) == 0, out.getvalue()
    rows = re.findall(r"^ *(\d\.\d\d) +(NEWT|STATUT) +([\d.]+) +([\d.]+) +([\d.]+) +(\d+)$", out.getvalue(), re.M)
    assert len(rows) == 2 * len(MU)
    return {(float(mu), method): [float(x) for x in values] for mu, method, *values in rows}


@pytest.mark.parametrize("n", [1, 2, pytest.param(3, marks=pytest.mark.slow), pytest.param(4, marks=pytest.mark.slow)])
def test_percentages_agree_with_the_prototypes(n: int) -> None:
    table = run_scene(n)
    for i, mu in enumerate(MU):
        assert table[mu, "NEWT"][2] == pytest.approx(EXACT[n][i], abs=0.05)
        assert table[mu, "NEWT"][1] == pytest.approx(CONTACT_EXACT[n][i], abs=0.05)
        assert table[mu, "STATUT"][2] == pytest.approx(STATUSES[n][i], abs=0.05)


CALCULATION = """
OPTI DIME 3 ELEM CUB8 MODE TRID ;
TB = BLOCS COTE N ;
MO = MODE (TB.'SOLIDES') 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ;
MA = MATE MO 'YOUN' 210000. 'NU' 0.3 ;
CL = BLOQ 'DEPL' (TB.'BASE') ;
F1 = PRES 'MASS' MO 3.125 (TB.'SOMMET') ;
SI MOITIE ;
  X = COOR 1 (TB.'SOMMET') ;
  F1 = PRES 'MASS' MO 3.125 ((TB.'SOMMET') ELEM 'APPU' 'STRI' (X POIN 'EGSUPE' -1.E-6)) ;
FINSI ;
MC = MODE (TB.'DESSUS') (TB.'DESSOUS') 'CONTACT' 'FROTTANT' 'COULOMB' ;
MATC = MATE MC 'MU' MU ;
RC JC = RIGI MC MATC ;
RAPP = TABL ;
U = RESO ((RIGI MO MA) ET CL ET RC) (F1 ET JC) 'RAPP' RAPP ;
REA = REAC RC U ;
RB = REAC CL U ;
"""


QUICK = ("T1_1", "T1_1h", "T2_1", "T2_1h", "T3_1h", "T4_4", "T4_4h")
SIDES = {"T1": 50.0, "T2": 100.0, "T3": 150.0, "T4": 200.0}


@pytest.mark.parametrize(
    "case",
    [
        case if case.startswith(QUICK + ("T1_2:0.2",)) else pytest.param(case, marks=pytest.mark.slow)
        for case in ORACLES
    ],
)
def test_script_agrees_with_the_independent_solution(case: str) -> None:
    name, mu = case.split(":")
    kind, number = name.split("_")
    side, half_loaded = SIDES[kind], number.endswith("h")
    count = float(number.rstrip("h"))
    # T1_n to T3_n have elements of 25/n mm; T4_m has m elements a side: 200/m = 25/n
    n = count / 8 if kind == "T4" else count
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names.update({"COTE": side, "N": n, "MU": float(mu), "MOITIE": half_loaded})
    assert session.run_text(CALCULATION) == 0, out.getvalue()
    names = session.globals.names
    u, rea, store = names["U"], names["REA"], names["U"].store
    expected = ORACLES[case]
    pairs = names["RC"].contacts[0].pairs
    X = store.coords
    half = side / 2

    def node(x: float, y: float, z: float, among: np.ndarray) -> np.ndarray:
        return among[[int(np.argmin(np.abs(X[among] - [x, y, z]).sum(axis=1)))]]

    top = names["TB"].get("HAUT").nodes
    slave, master = pairs.pairs.T
    shift = np.column_stack([u.at(c, slave) - u.at(c, master) for c in ("UX", "UY", "UZ")])
    force = np.column_stack([rea.at(c, slave) for c in ("FX", "FY", "FZ")])
    normal, friction, slip = force[:, 2], np.hypot(force[:, 0], force[:, 1]), np.hypot(shift[:, 0], shift[:, 1])
    displacements = {
        "uz_top_centre": u.at("UZ", node(0, 0, 200 + side, top))[0],
        "uz_top_corner": u.at("UZ", node(half, half, 200 + side, top))[0],
        "ux_top_corner": u.at("UX", node(half, half, 200 + side, top))[0],
        "uz_cont_centre_up": u.at("UZ", node(0, 0, 200, slave))[0],
        "uz_cont_corner_up": u.at("UZ", node(half, half, 200, slave))[0],
        "max_slip": slip.max(),
    }
    scale = max(abs(expected[k]) for k in displacements)
    for key, value in displacements.items():
        assert value == pytest.approx(expected[key], abs=1e-6 * scale), key
    forces = {"sum_Fn": normal.sum(), "sum_abs_Ft": friction.sum()}
    for key, value in forces.items():
        assert value == pytest.approx(expected[key], abs=1e-6 * expected["sum_Fn"]), key
    open_, stick, slipping = names["RAPP"].get("STATUTS").values
    assert (open_, slipping) == (expected["n_open"], expected["n_slip"])
    assert open_ + stick + slipping == expected["n_closed"] + expected["n_open"]
    # the supports carry the load, and the laws hold at every node
    load = sum(v.sum() for _, v in [names["F1"].parts["FZ"]])
    assert names["RB"].parts["FZ"][1].sum() == pytest.approx(-load, rel=1e-9)
    assert (shift[:, 2] >= -1e-8 * scale).all()
    assert (friction <= float(mu) * normal + 1e-8 * normal.max()).all()
