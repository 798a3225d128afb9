"""What estimates cost: against the contact solution, per tetrahedron and sweep, and for what they are worth."""

import io
import time
from pathlib import Path

import numpy as np
import pytest

from gibiane.session import Session

BLOCKS = """OPTI DIME 3 ELEM CUB8 ;
N1 = 8 * {n} ; N2 = 2 * {n} ;
S1 = (DROI N2 (-25. -25. 0.) (25. -25. 0.)) TRAN N2 (0. 50. 0.) ; V1 = S1 VOLU N2 'TRAN' (0. 0. 50.) ;
S2 = (DROI N1 (-100. -100. 0.) (100. -100. 0.)) TRAN N1 (0. 200. 0.) ; V2 = S2 VOLU N1 'TRAN' (0. 0. -200.) ;
MO = (MODE V1 'MECANIQUE' 'ELASTIQUE') ET (MODE V2 'MECANIQUE' 'ELASTIQUE') ; MA = MATE MO 'YOUN' 2.1E5 'NU' 0.3 ;
MC = MODE (FACE 1 V2) (FACE 1 V1) 'CONTACT' 'FROTTANT' 'COULOMB' ; MATC = MATE MC 'MU' 0.2 ;
CL = BLOQ 'DEPL' (FACE 2 V2) ;
P = PRES 'MASS' MO 3.125 (FACE 2 V1) ;
"""
CONTACT = "RC JC = RIGI MC MATC ; U = RESO ((RIGI MO MA) ET RC ET CL) (P ET JC) ;"
CUBE = """OPTI DIME 3 ELEM CUB8 ;
S = (DROI {n} (0. 0. 0.) (1. 0. 0.)) TRAN {n} (0. 1. 0.) ; V = S VOLU {n} 'TRAN' (0. 0. 1.) ;
HAUT = FACE 2 V ; BAS = FACE 1 V ;
{cut}
MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1. 'NU' 0.3 ; CL = BLOQ 'DEPL' BAS ;
U = RESO ((RIGI MO MA) ET CL) (PRES 'MASS' MO 1. HAUT) ; SIG = SIGM MO MA U ;
"""
CUT = "V = CHAN TET4 V ; HAUT = CHAN TRI3 HAUT ; BAS = CHAN TRI3 BAS ;"
# Energy of the clamped cube under pressure, extrapolated from CUB8 and CU20.
EXACT = 0.97060


def session_of(text):
    session = Session(out=io.StringIO(), err=io.StringIO())
    assert session.run_text(text) == 0, session.err.getvalue()
    return session


def runs(session, text):
    def run():
        assert session.run_text(text) == 0, session.err.getvalue()

    return run


@pytest.mark.bench
def test_patches_and_map_against_the_contact_solution(bench, sizes):
    for n in sizes:
        session = session_of(BLOCKS.format(n=n))
        solve = runs(session, CONTACT)

        def contact(session=session, solve=solve):
            session.state.get("factors", {}).clear()  # a solution from the start: the factor of the last one is kept
            solve()

        contact()
        runs(session, "REA = REAC RC U ; SIG = SIGM MO MA U ;")()
        judge = runs(session, "XS XC XG CA = ERREUR 'CONTACT' 'SPR' MO SIG MA MC MATC U REA ;")
        size = f"{520 * n**3} CUB8"
        # Small problems are solved in no time: the aim is for the finest mesh of the scene.
        bench.compare("SPR + error map", size, judge, {"contact solution": contact}, aim=0.1 if n >= 4 else None)


@pytest.mark.bench
def test_bound_per_tetrahedron_and_sweep(bench):
    bound = "T = ERREUR 'RDC' MO SIG MA CL 'PRES' 1. HAUT 'BALA' {sweeps} 'TABL' ;"
    # both meshes are improved by parts
    small, large = (session_of(CUBE.format(n=n, cut=CUT)) for n in (10, 14))
    few, many = (int(session.names()["V"].n_cells) for session in (small, large))
    best = {}
    for sweeps in (1, 3, 1, 3):
        start = time.perf_counter()
        runs(small, bound.format(sweeps=sweeps))()
        best[sweeps] = min(best.get(sweeps, np.inf), time.perf_counter() - start)
    bench.notes.append(
        f"RDC, {few} TET4: {1e3 * best[1] / few:.2f} ms a tetrahedron for one sweep, "
        f"{1e3 * (best[3] - best[1]) / 2 / few:.2f} for each of two more (aim: below 1)"
    )
    once, peer = runs(large, bound.format(sweeps=1)), {f"{few} TET4": runs(small, bound.format(sweeps=1))}
    bench.compare("RDC, cost per element", f"{many} TET4", once, peer, aim=1.2, rounds=1, scale=many / few)


@pytest.mark.bench
def test_bound_of_elements_that_are_cut(bench):
    text = "T = ERREUR 'RDC' MO SIG MA CL 'PRES' 1. HAUT 'TABL' ;"
    quadratic = (
        "V = CHAN 'QUADRATIQUE' V ; E = ENVE V ; Z = COOR 3 E ; HAUT = E ELEM 'APPU' 'STRI' (Z POIN 'EGSUPE' 0.999) ;"
    )
    quadratic += " BAS = E ELEM 'APPU' 'STRI' (Z POIN 'EGINFE' 0.001) ;"
    few = 6 * 8**3
    peer = {f"{few} TET4": runs(session_of(CUBE.format(n=8, cut=CUT)), text)}
    # bricks in six tetrahedra, quadratic ones in 24, quadratic tetrahedra in eight
    for name, n, cut, pieces in (
        ("CUB8", 8, "", 6 * 8**3),
        ("CU20", 5, quadratic, 24 * 5**3),
        ("TE10", 4, "V = CHAN TET4 V ; " + quadratic, 48 * 4**3),
    ):
        run = runs(session_of(CUBE.format(n=n, cut=cut)), text)
        bench.compare("RDC, cost per piece", f"{name} in {pieces}", run, peer, aim=2.0, rounds=1, scale=pieces / few)


@pytest.mark.bench
def test_cost_against_effectivity(bench):
    texts = {name: f"T = ERREUR '{name}' MO SIG MA 'TABL' 'REFE' {EXACT} ;" for name in ("MOYE", "MOYC", "PROJ", "SPR")}
    texts["SPRE"] = f"T = ERREUR MO SIG MA (LISSER 'SPRE' MO SIG CL 'PRES' 1. HAUT) 'TABL' 'REFE' {EXACT} ;"
    texts["RESI"] = f"T = ERREUR 'RESI' MO SIG MA CL 'PRES' 1. HAUT 'TABL' 'REFE' {EXACT} ;"
    for sweeps in (1, 2):
        texts[f"RDC {sweeps}"] = f"T = ERREUR 'RDC' MO SIG MA CL 'PRES' 1. HAUT 'BALA' {sweeps} 'TABL' 'REFE' {EXACT} ;"
    rows = []
    for element, cut, n in (("CUB8", "", 10), ("TET4", CUT, 8)):
        session = session_of(CUBE.format(n=n, cut=cut))
        # A new material, so that no factor is kept from before.
        solve = runs(
            session, "MA = MATE MO 'YOUN' 1. 'NU' 0.3 ; U = RESO ((RIGI MO MA) ET CL) (PRES 'MASS' MO 1. HAUT) ;"
        )
        start = time.perf_counter()
        solve()
        solution = time.perf_counter() - start
        for name, text in texts.items():
            run = runs(session, text)
            run()
            start = time.perf_counter()
            run()
            rows.append((element, name, (time.perf_counter() - start) / solution, session.names()["T"].get("THETA")))
            bench.notes.append(f"{element} {name}: {rows[-1][2]:.2f} of the solution's time, theta {rows[-1][3]:.2f}")
    chart(rows, Path(__file__).parents[2] / "bench-results" / "estimates.png")


def chart(rows, path):
    """Draw theta against time, one mark an estimate."""
    from matplotlib.figure import Figure

    path.parent.mkdir(exist_ok=True)
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for element, colour in (("CUB8", "#1f77b4"), ("TET4", "#d95f02")):
        own = [row for row in rows if row[0] == element]
        axes.scatter([r[2] for r in own], [r[3] for r in own], color=colour, label=element)
        labels: list[list] = []
        for _, name, cost, theta in own:
            near = [each for each in labels if abs(each[2] - theta) < 0.01 and 0.8 < cost / each[1] < 1.25]
            if near:
                near[0][0] += ", " + name
            else:
                labels.append([name, cost, theta])
        below = element == "TET4"  # so that marks of the two elements at one place keep their names
        for name, cost, theta in labels:
            axes.annotate(name, (cost, theta), textcoords="offset points", xytext=(5, -10 if below else 4), fontsize=8)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlim(right=2.5 * max(row[2] for row in rows))
    axes.set_xlabel("time of the estimate over time of the solution")
    axes.set_ylabel("estimate over true error")
    axes.set_title("Clamped cube under pressure: what estimates cost and are worth")
    axes.legend()
    figure.savefig(path, dpi=150)
