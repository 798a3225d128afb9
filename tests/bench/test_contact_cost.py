"""Contact with friction between two blocks: against one bonded solution by the same solver, and against other codes."""

import copy
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gibiane.session import Session
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.correction import solve_corrected
from gibiane_ops.kernels.contact.law import friction
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.problem import Problem
from gibiane_ops.kernels.contact.solver_error import solver_error
from gibiane_ops.kernels.solve import factorize

HERE = Path(__file__).parent
SIDES = {"T1": 50.0, "T2": 100.0, "T4": 200.0}
TABLE_01 = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
T4_SIZES = {2: 8, 3: 16, 4: 22}

SCENE = """OPTI DIME 3 ELEM CUB8 ;
B = (DROI {n1} (-100. -100. -200.) (100. -100. -200.)) TRAN {n1} (0. 200. 0.) ; V1 = B VOLU {n1} 'TRAN' (0. 0. 200.) ;
T = (DROI {n2} (-{a} -{a} 0.) ({a} -{a} 0.)) TRAN {n2} (0. {side} 0.) ; V2 = T VOLU {n2} 'TRAN' (0. 0. {side}) ;
V = V1 ET V2 ; MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 210000. 'NU' 0.3 ;
K = (RIGI MO MA) ET (BLOQ 'DEPL' B) ; F = PRES 'MASS' MO 3.125 (FACE 2 V2) ;
"""
CONTACT = """MC = MODE (FACE 2 V1) (FACE 1 V2) 'CONTACT' 'FROTTANT' 'COULOMB' ;
KC JC = RIGI MC (MATE MC 'MU' 0.2) ; KC = K ET KC ; FC = F ET JC ;
"""
TIED = """ELIM V 1.E-3 ; KB = (RIGI MO MA) ET (BLOQ 'DEPL' B) ; FB = PRES 'MASS' MO 3.125 (FACE 2 V2) ;
"""


def text(family, n):
    """Return the script of a scene."""
    side = SIDES[family]
    n1 = n if family == "T4" else 8 * n
    return SCENE.format(n1=n1, n2=round(n1 * side / 200), a=side / 2, side=side)


def session(script):
    found = Session(out=io.StringIO(), err=io.StringIO())
    assert found.run_text(script) == 0, found.err.getvalue()
    return found


def solving(found, script):
    """Return a function that runs a script in a session, without any factor kept."""

    def run():
        found.state.get("factors", {}).clear()
        assert found.run_text(script) == 0, found.err.getvalue()

    return run


@pytest.mark.bench
@pytest.mark.parametrize("wish", ["DIRE", "ITER"])
def test_contact_against_one_bonded_solution(bench, sizes, wish):
    option = f"OPTI 'RESO' '{wish}' ;\n"
    scenes = [("T1", n, n, 1.25 if n == 4 else None) for n in sizes]
    scenes += [("T2", sizes[-1], sizes[-1], 1.5), ("T4", T4_SIZES.get(sizes[-1], 8), sizes[-1], 1.5)]
    for family, number, n, aim in scenes:
        aim = aim if n == 4 and wish == "DIRE" else None
        contact = session(option + text(family, number) + CONTACT)
        bonded = session(option + text(family, number) + TIED)
        size = f"{family} {number}, {'a factor' if wish == 'DIRE' else 'multigrid'}"
        one = {"bonded RESO": solving(bonded, "U = RESO KB FB ;")}
        bench.compare("contact, MU 0.2", size, solving(contact, "U = RESO KC FC ;"), one, aim=aim, rounds=5)
        if family != "T1":
            continue
        mus = " ".join(f"KC JC = RIGI MC (MATE MC 'MU' {mu}) ; U = RESO (K ET KC) (F ET JC) ;" for mu in TABLE_01)
        bench.compare("contact, seven MU", size, solving(contact, mus), one, aim=1.75 if aim else None, rounds=5)


@pytest.mark.bench
def test_whole_script_against_other_codes(bench, sizes, tmp_path):
    """Run each code once as a process, mesh and output included."""
    n = min(sizes[-1], 3)
    script = tmp_path / "blocks.dgibi"
    script.write_text(text("T1", n) + CONTACT + "U = RESO KC FC ; MESS (MINI (EXCO 'UZ' U)) ;\n", encoding="utf-8")
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    peer_env = {name: value for name, value in env.items() if name != "PYTHONPATH"}
    folder = HERE / "peers"

    def process(*command, env=peer_env):
        def run():
            done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=True)
            lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
            if lines:
                result = json.loads(lines[-1])
                assert result.get("finished", True), result
                assert result.get("converged", True), result

        return run

    peers = {}
    if shutil.which("ccx"):
        for kind in ("N2S", "S2S"):
            peers[f"CalculiX {kind}"] = process(sys.executable, "ccx_contact.py", str(tmp_path), f"T1_{n}", "0.2", kind)
    else:
        bench.skipped("CalculiX", "calculix-ccx")
    system = shutil.which("python3", path="/usr/bin:/usr/local/bin")
    if system and subprocess.run([system, "-c", "import getfem"], env=peer_env, capture_output=True).returncode == 0:
        peers["GetFEM integral"] = process(system, "getfem_contact.py", f"T1_{n}", "0.2", "gwfl")
    else:
        bench.skipped("GetFEM", "python3-getfem")
    ours = process(sys.executable, "-m", "gibiane", str(script), env=env)
    bench.compare("contact, whole script", f"T1 {n}", ours, peers, aim=0.2, rounds=1)


@pytest.mark.bench
def test_memory_of_a_whole_script(bench, sizes):
    n = sizes[-1]
    code = (
        "import io, resource; from gibiane.session import Session; s = Session(out=io.StringIO(), err=io.StringIO());"
        f"assert s.run_text({text('T1', n) + CONTACT + 'U = RESO KC FC ;'!r}) == 0;"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    bench.notes.append(
        f"contact, T1 {n}: peak of {float(done.stdout) / 1e3:.0f} Mbyte for the process (aim: below 2500 at 4)"
    )


@pytest.mark.bench
def test_an_iteration_against_its_factorisation(bench, sizes):
    """Say why condensed contact does not stop early: one Newton step of the interface, and the tied factorisation."""
    sys.path.insert(0, str(HERE.parent / "scenes"))
    from two_blocks import blocks

    for n in sizes:
        scene = blocks(f"T1_{n}")
        interface = scene.interface
        law = friction(interface.n_pairs, mu=0.2)
        problem = Problem.of(interface, law, 1.0)
        state = solve_coulomb(interface, law)
        w, r = state.w / problem.length, state.r / problem.force
        peers = {
            "factorisation": lambda scene=scene: factorize(scene.tied.tied.A),
            "factorisation and Schur complement": lambda scene=scene: condense(
                scene.K, scene.pairs, scene.reduction, points=scene.points
            ).exact(),
        }

        def step(problem=problem, w=w, r=r):
            return problem.step(w, r)

        bench.compare("one iteration on the condensed interface", f"T1 {n}", step, peers, rounds=5)
        share = bench.rows[-2]["ours"] / bench.rows[-2]["peer_time"]
        bench.notes.append(f"T1 {n}: one contact iteration costs {share:.3%} of the factorisation of the tied solids")

        def estimate(interface=interface, state=state):
            return solver_error(interface, state)

        bench.compare("estimate of the solver error", f"T1 {n}", estimate, peers, rounds=5)


@pytest.mark.bench
def test_corrections_that_stop_early(bench, sizes):
    """RESO 'KRYL' 'ARRE': a small model corrected until a thousandth of the energy norm is left, and to the end."""
    sys.path.insert(0, str(HERE.parent / "scenes"))
    from two_blocks import blocks

    for n in sizes:
        scene = blocks(f"T1_{n}")
        bodies = condense(scene.K, scene.pairs, scene.reduction, points=scene.points, method="single")
        load = bodies.load(scene.F)
        gap = bodies.gaps(load, None, None)

        def corrected(enough, bodies=bodies, load=load, gap=gap):
            # a copy has learned nothing yet
            fresh = copy.copy(bodies)
            return solve_corrected(fresh, load, gap, lambda each: solve_coulomb(each, 0.2), enough=enough)

        u = corrected(0.0).displacement
        enough = 1e-3 * float(np.sqrt(u @ scene.K @ u))
        peers = {"to the end": lambda corrected=corrected: corrected(0.0)}
        bench.compare(
            "corrections stopped early", f"T1 {n}", lambda corrected=corrected, e=enough: corrected(e), peers, rounds=5
        )


def energy(found):
    """Return ``a(u, u)``: the work of the load less what friction dissipates."""
    names = found.names()
    nodes, forces = names["F"].parts["FZ"]
    return float(forces @ names["U"].at("UZ", nodes)) - names["R"].get("DISSIPATION")


@pytest.mark.bench
@pytest.mark.skipif(
    not os.environ.get("GIBIANE_BENCH_LARGE"), reason="GIBIANE_BENCH_LARGE=9: a million unknowns, 8 Gbyte"
)
def test_large_contact_by_multigrid(bench):
    """Note the ratio to the bonded solution, the energy (10.13124962 at 9) and the peak of memory."""
    import resource

    n = int(os.environ["GIBIANE_BENCH_LARGE"])
    option = "OPTI 'RESO' 'ITER' ;\n"
    contact = session(option + text("T1", n) + CONTACT)
    bonded = session(option + text("T1", n) + TIED)
    one = {"bonded RESO": solving(bonded, "U = RESO KB FB ;")}
    run = solving(contact, "R = TABL ; U = RESO KC FC 'RAPP' R ;")
    bench.compare("contact, MU 0.2", f"T1 {n}, multigrid", run, one, aim=2.5, rounds=1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    bench.notes.append(f"T1 {n}: energy {energy(contact):.8f}; both models and solvers took {peak:.2f} Gbyte at most")
