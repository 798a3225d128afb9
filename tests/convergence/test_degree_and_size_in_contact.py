"""hp against h in contact: two blocks without friction at the true error, a footing at the estimated one."""

import io
from functools import lru_cache

import numpy as np
import pytest

from gibiane.session import Session

pytestmark = pytest.mark.slow

EXACT = 84.28
"""Energy of the two blocks without friction, extrapolated from h on quadratic tetrahedra and from hp; +-0.02."""

MEASURED = """
DEBP CALMES MA*'MAILLAGE' TG*'TABLE' ;
  TR = {solve} MA TG ;
  EN = INTG (TR.'MODELE') (ENER (TR.'MODELE') (TR.'CONTRAINTE') (EPSI (TR.'MODELE') (TR.'DEPLACEMENT'))) ;
  MESS 'PASS' (NBNO MA)*20 'FORMAT' '(F22.14)' EN*50 ;
FINP TR ;
T1 = {make} ; T1.'CALCUL' = MOT 'CALMES' ; TG = T1.'GROUPES' ; TG.'MU' = 0. ;
"""
RAISED = """
MA = T1.'MAILLAGE' ; TG = T1.'GROUPES' ;
MB TB = REMAILLER MA (MANU 'CHML' (MODE MA 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE') 'SCAL' 1. 'GRAVITE') 'GROU' TG ;
T1.'MAILLAGE' = MB ; T1.'GROUPES' = TB ;
"""
SCENES = {"two blocks": ("DEUXBLOCS 100. 4 3", "CALBLOCS"), "footing": ("SEMELLE 0.8 'QUAR'", "CALSEMEL")}
RUNS = {"hp": ("HP", ""), "h": ("HLOC", ""), "quadratic h": ("HLOC", RAISED)}
RATE = {"hp": 0.5, "h": 1 / 3, "quadratic h": 0.5}
"""Theory, isotropic elements along an edge where u goes as r^(1/2): N^(-min(p / 3, lambda))."""


@lru_cache
def last_pass(scene, name, error):
    """Adapt; return nodes, estimated error and energy of the pass of least error."""
    make, solve = SCENES[scene]
    method, before = RUNS[name]
    out = io.StringIO()
    session = Session(out=out, err=io.StringIO())
    text = MEASURED.format(make=make, solve=solve)
    assert session.run_text(f"{text} {before} T2 = ADAPTER T1 'PREC' {error} 'METH' '{method}' ;") < 8
    rows = np.array([line.split()[1:] for line in out.getvalue().splitlines() if line.startswith("PASS")], float)
    found = session.names()["T2"]
    assert str(found.get("ARRET")) == "ATTEINT"
    best = found.get("MEILLEUR")
    return rows[best - 1, 0], found.get(best).get("GLOBALE"), rows[best - 1, 1]


def nodes_for(name, nodes, error, wanted):
    return nodes * (error / wanted) ** (1 / RATE[name])


@pytest.mark.parametrize(("name", "error"), [("h", 0.1), ("quadratic h", 0.06)])
def test_hp_on_two_blocks_needs_no_more_nodes_than_h(name, error):
    nodes, estimated, energy = last_pass("two blocks", "hp", 0.07)
    true = np.sqrt((EXACT - energy) / EXACT)
    others, other_estimate, other_energy = last_pass("two blocks", name, error)
    other_true = np.sqrt((EXACT - other_energy) / EXACT)
    assert nodes <= nodes_for(name, others, other_true, true)
    assert nodes <= nodes_for(name, others, other_estimate, estimated)


@pytest.mark.parametrize("name", ["h", "quadratic h"])
def test_hp_on_the_footing_needs_no_more_nodes_than_h(name):
    nodes, estimated, _ = last_pass("footing", "hp", 0.16)
    others, other_estimate, _ = last_pass("footing", name, 0.18)
    assert nodes <= nodes_for(name, others, other_estimate, estimated)
