"""hp against h and against p on the L-shaped plate, at the true error."""

import io

import numpy as np

from gibiane.session import Session

EXACT = 11.553656
"""Strain energy, extrapolated: 49 055 nodes of graded quadratic triangles give 11.553655."""

MEASURED = """
DEBP CALMES MA*'MAILLAGE' TG*'TABLE' ;
  TR = CALEQUER MA TG ;
  EN = INTG (TR.'MODELE') (ENER (TR.'MODELE') (TR.'CONTRAINTE') (EPSI (TR.'MODELE') (TR.'DEPLACEMENT'))) ;
  MESS 'PASS' (NBNO MA)*20 'FORMAT' '(F22.14)' EN*50 ;
FINP TR ;
T1 = EQUERRE 4 ; T1.'CALCUL' = MOT 'CALMES' ;
"""
RAISED = """
MA = T1.'MAILLAGE' ; TG = T1.'GROUPES' ;
MB TB = REMAILLER MA (MANU 'CHML' (MODE MA 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE') 'SCAL' 1. 'GRAVITE') 'GROU' TG ;
T1.'MAILLAGE' = MB ; T1.'GROUPES' = TB ;
"""


def passes(method, error, before="", start="EQUERRE 4"):
    """Adapt; return the nodes and the true relative error of each pass."""
    out = io.StringIO()
    session = Session(out=out, err=io.StringIO())
    text = MEASURED.replace("EQUERRE 4", start) + before
    assert session.run_text(f"{text} T2 = ADAPTER T1 'PREC' {error} 'METH' '{method}' 'NPAS' 8 ;") < 8
    rows = [line.split()[1:] for line in out.getvalue().splitlines() if line.startswith("PASS")]
    nodes, energy = np.array(rows, float).T
    return nodes, np.sqrt((EXACT - energy) / EXACT), str(session.names()["T2"].get("ARRET"))


def test_hp_reaches_two_and_one_percent_with_fewer_nodes_than_h_and_p():
    nodes, errors, stop = passes("HP", 0.02)
    assert stop == "ATTEINT"
    assert errors[-1] < 0.02
    assert nodes[-1] < 2500
    fine_nodes, fine_errors, stop = passes("HP", 0.01)
    assert stop == "ATTEINT"
    assert fine_errors[-1] < 0.01
    assert fine_nodes[-1] < 7000
    # h: at 8499 nodes no pass is below 1.9 %, and its rate is N^(-1/2): 1 % takes four times as many.
    h_nodes, h_errors, stop = passes("HLOC", 0.02)
    assert stop == "ATTEINT"
    best = (h_errors * np.sqrt(h_nodes)).min()
    assert nodes[-1] < 0.4 * (best / 0.02) ** 2
    assert fine_nodes[-1] < 0.3 * (best / 0.01) ** 2
    # p: raising elements changes nothing at the corner
    _, p_errors, stop = passes("P", 0.02)
    assert stop == "STAGNATION"
    assert p_errors[-1] > 0.1
    # nor does the second degree everywhere on uniform meshes
    p_nodes, p_errors, _ = passes("P", 0.02, RAISED, "EQUERRE 24")
    assert p_nodes[0] > fine_nodes[-1]
    assert p_errors[0] > 3 * fine_errors[-1]
