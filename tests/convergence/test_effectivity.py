"""Every estimate of a thick tube in plane strain against its true error: ratio, scatter and rate."""

import io
from functools import lru_cache

import numpy as np
import pytest

from gibiane import Session

SCRIPT = """
DEBP TUBE X*'LISTREEL' Y*'LISTREEL' ;
  R2 = (X * X) + (Y * Y) ; C = 1. / 3. ; Q = 4. * C / (R2 * R2) ; T = TABLE ;
  T.'SMXX' = (C * ((0. * R2) + 1.)) - (Q * ((X * X) - (Y * Y))) ;
  T.'SMYY' = (C * ((0. * R2) + 1.)) + (Q * ((X * X) - (Y * Y))) ;
  T.'SMXY' = (-2. * Q) * X * Y ; T.'SMZZ' = 0.6 * C * ((0. * R2) + 1.) ;
FINP T ;
OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;
A = CERC N (1. 0.) (0. 0.) (0. 1.) ; B = CERC N (2. 0.) (0. 0.) (0. 2.) ; S = CHAN TYPEL (REGL N A B) ;
MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1. 'NU' 0.3 ;
CL = (BLOQ 'UY' (S POIN 'DROI' (0. 0.) (1. 0.) 1.E-6)) ET (BLOQ 'UX' (S POIN 'DROI' (0. 0.) (0. 1.) 1.E-6)) ;
U = RESO ((RIGI MO MA) ET CL) (PRES 'MASS' MO 1. A) ; SIG = SIGM MO MA U ;
X CA E = ERREUR 'EXAC' MO SIG MA 'PROC' 'TUBE' 'ABSO' ; MESS 'EXAC ' X ;
L = MOTS 'MOYE' 'MOYC' 'PROJ' 'SPR' ;
REPE BL 4 ;
  T = ERREUR (EXTR L &BL) MO SIG MA 'TABL' 'REFE' CA ; MESS (EXTR L &BL) ' ' T.THETA ' ' T.SD ;
FIN BL ;
T = ERREUR 'RESI' MO SIG MA CL 'PRES' 1. A 'TABL' 'REFE' CA ; MESS 'RESI ' T.THETA ' ' T.SD ;
SI ('EGA' TYPEL 'TRI3') ;
  T = ERREUR 'RDC' MO SIG MA CL 'PRES' 1. A 'TABL' 'REFE' CA ; MESS 'RDC ' T.THETA ' ' T.SD ;
FINSI ;
"""


@lru_cache
def measured(shape: str, n: int) -> dict[str, list[float]]:
    """Name of the estimate to theta and SD; of EXAC to the relative error."""
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names["N"] = n
    session.globals.names["TYPEL"] = shape
    assert session.run_text(SCRIPT) == 0, out.getvalue()
    rows = [line.split() for line in out.getvalue().splitlines()]
    return {row[0]: [float(x) for x in row[1:]] for row in rows}


@pytest.mark.parametrize("shape", ["QUA4", "TRI3"])
def test_smoothed_stresses_follow_a_smooth_error(shape):
    coarse, fine = measured(shape, 8), measured(shape, 16)
    assert np.log2(coarse["EXAC"][0] / fine["EXAC"][0]) == pytest.approx(1, abs=0.03)
    for method in ("MOYE", "PROJ", "SPR"):
        theta, scatter = fine[method]
        assert 0.8 <= theta <= 1.2
        assert scatter <= 0.2
        # asymptotically exact, and more even, as the mesh is refined
        assert abs(theta - 1) <= abs(coarse[method][0] - 1) + 0.01
        assert scatter < coarse[method][1]


@pytest.mark.parametrize("shape", ["QUA4", "TRI3"])
def test_residuals_converge_like_the_error(shape):
    coarse, fine = measured(shape, 16), measured(shape, 32)
    # theta is the estimate over the error: its own rate is the difference of theirs
    assert abs(np.log2(fine["RESI"][0] / coarse["RESI"][0])) < 0.06
    assert 0.5 < fine["RESI"][0] < 1.5


@pytest.mark.parametrize("n", [8, 16, 32])
def test_equilibrated_stress_bounds_the_error(n):
    theta, _ = measured("TRI3", n)["RDC"]
    # what is left above 1 comes from the chords that stand for the arcs, and goes with the size
    assert 1 <= theta <= 1 + 0.8 / n


SPHERE = """
DEBP BOULE X*'LISTREEL' Y*'LISTREEL' ;
  R2 = (X * X) + (Y * Y) ; C = 1. / 7. ; Q = 8. * C / (R2 ** 1.5) ; UN = (0. * R2) + 1. ; D = (-1.5 * Q) / R2 ;
  T = TABLE ; T.'SMTT' = (C * UN) + (0.5 * Q) ;
  T.'SMRR' = (T.'SMTT') + (D * X * X) ; T.'SMZZ' = (T.'SMTT') + (D * Y * Y) ; T.'SMRZ' = D * X * Y ;
FINP T ;
OPTI DIME 2 MODE AXIS ELEM DEGRE ;
A = CERC N (1. 0.) (0. 0.) (0. 1.) ; B = CERC N (2. 0.) (0. 0.) (0. 2.) ; S = CHAN TYPEL (REGL N A B) ;
MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1. 'NU' 0.3 ;
CL = (BLOQ 'UZ' (S POIN 'DROI' (0. 0.) (1. 0.) 1.E-6)) ET (BLOQ 'UR' (S POIN 'DROI' (0. 0.) (0. 1.) 1.E-6)) ;
U = RESO ((RIGI MO MA) ET CL) (PRES 'MASS' MO 1. A) ; SIG = SIGM MO MA U ;
X CA E = ERREUR 'EXAC' MO SIG MA 'PROC' 'BOULE' 'ABSO' ; MESS 'EXAC ' X ;
T = ERREUR 'SPR' MO SIG MA 'TABL' 'REFE' CA ; MESS 'SPR ' T.THETA ' ' T.SD ;
SL = LISSER 'SPRE' MO SIG CL 'PRES' 1. A ; T = ERREUR MO SIG MA SL 'TABL' 'REFE' CA ; MESS 'SPRE ' T.THETA ' ' T.SD ;
T = ERREUR 'RESI' MO SIG MA CL 'PRES' 1. A 'TABL' 'REFE' CA ; MESS 'RESI ' T.THETA ' ' T.SD ;
"""


@lru_cache
def round_an_axis(shape: str, n: int) -> dict[str, list[float]]:
    """As `measured`, of a hollow sphere under pressure, the axis in its mesh."""
    out = io.StringIO()
    session = Session(out=out, err=out)
    session.globals.names |= {"N": n, "TYPEL": shape, "DEGRE": "QUA8" if shape in ("QUA8", "TRI6") else "QUA4"}
    assert session.run_text(SPHERE) == 0, out.getvalue()
    rows = [line.split() for line in out.getvalue().splitlines()]
    return {row[0]: [float(x) for x in row[1:]] for row in rows}


@pytest.mark.parametrize(("shape", "degree"), [("QUA4", 1), ("TRI3", 1), ("QUA8", 2), ("TRI6", 2)])
def test_sphere_about_an_axis(shape, degree):
    n = 16 // degree
    coarse, fine = round_an_axis(shape, n), round_an_axis(shape, 2 * n)
    assert np.log2(coarse["EXAC"][0] / fine["EXAC"][0]) == pytest.approx(degree, abs=0.05)
    theta, scatter = fine["SPRE"]
    assert 0.8 <= theta <= 1.2
    assert scatter <= 0.2
    assert abs(theta - 1) <= abs(fine["SPR"][0] - 1) + 0.01
    assert abs(np.log2(fine["RESI"][0] / coarse["RESI"][0])) < 0.06
    assert 0.5 < fine["RESI"][0] < 2.5
