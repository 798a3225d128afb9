"""The second degree by zone on Lame's tube: exact errors, rates of both degrees, elements raised where it pays."""

import io
from functools import lru_cache

import numpy as np
import pytest

from gibiane.session import Session
from gibiane_ops.kernels import elasticity, geometry, quadrature
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.materials import isotropic

INNER, OUTER, NU = 1.0, 4.0, 0.3
# u_r = A r + B / r, Young's modulus 1, pressure 1 inside; plane strain
A = (1 + NU) * (1 - 2 * NU) * INNER**2 / (OUTER**2 - INNER**2)
B = (1 + NU) * INNER**2 * OUTER**2 / (OUTER**2 - INNER**2)
# The displacement is imposed on the whole boundary, so that the polygon of a mesh has the same solution as the tube.
SCRIPT = f"""
DEBP CALTUBE MA*'MAILLAGE' TG*'TABLE' ;
  MO = MODE MA 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ;
  MAT = MATE MO 'YOUN' 1. 'NU' {NU} ;
  X Y = COOR (TG.'BORD') ;
  F = {A:.16f} + ({B:.16f} * (((X * X) + (Y * Y)) ** -1)) ;
  CL = BLOQ 'DEPL' (TG.'BORD') ;
  D = DEPI CL ((NOMC 'UX' (X * F)) ET (NOMC 'UY' (Y * F))) ;
  U = RESO ((RIGI MO MAT) ET CL ET (RELA MO)) D ;
  TR = TABL ;
  TR.'MODELE' = MO ; TR.'MATERIAU' = MAT ; TR.'DEPLACEMENT' = U ; TR.'CONTRAINTE' = SIGM MO MAT U ;
FINP TR ;
OPTI DIME 2 ELEM QUA4 MODE PLAN DEFO ;
S = (DROI (3 * N) ({INNER} 0.) ({OUTER} 0.)) 'ROTA' (2 * N) 90. (0. 0.) ;
S = CHAN 'TRI3' S ;
TG = TABL ; TG.'BORD' = CONT S ;
T1 = TABL ; T1.'MAILLAGE' = S ; T1.'GROUPES' = TG ; T1.'CALCUL' = MOT 'CALTUBE' ;
SI QUAD ;
  MO = MODE S 'MECANIQUE' 'ELASTIQUE' 'ISOTROPE' ;
  T1.'MAILLAGE' T1.'GROUPES' = REMAILLER S (MANU 'CHML' MO 'SCAL' 1. 'GRAVITE') 'GROU' TG ;
FINSI ;
"""


@lru_cache
def tube(n, quadratic=False, wanted=1e-6, changes=0):
    """Adapt by 'P'; return nodes, relative true error in energy, why it stopped, the radii of each degree."""
    err = io.StringIO()
    session = Session(out=io.StringIO(), err=err)
    head = f"N = {n} ; QUAD = {'VRAI' if quadratic else 'FAUX'} ;"
    text = f"{head} {SCRIPT} T2 = ADAPTER T1 'PREC' {wanted} 'METH' 'P' 'NPAS' {changes} ;"
    assert session.run_text(text) < 8, err.getvalue()
    found = session.names()["T2"]
    result = found.get("RESULTAT")
    model, u = result.get("MODELE"), result.get("DEPLACEMENT")
    coords = found.get("MAILLAGE").store.coords[:, :2]
    D = isotropic(1.0, NU, "DEFO")
    rule = quadrature.triangle(4)
    error2 = energy = 0.0
    radii = {1: np.zeros(0), 2: np.zeros(0)}
    for zone in model.zones:
        of, X = shape(zone.shape), coords[zone.cells]
        U = u.table(("UX", "UY"), zone.cells.ravel()).reshape(*zone.cells.shape, 2)
        x, y = np.moveaxis(geometry.positions(of, X, rule.points), -1, 0)
        r2 = x**2 + y**2
        exact = np.stack(
            [A + B * (y**2 - x**2) / r2**2, A + B * (x**2 - y**2) / r2**2, 0 * x, -4 * B * x * y / r2**2], -1
        )
        gap = exact - elasticity.strains(of, X, U, rule.points)
        weight = geometry.measure_densities(of, X, rule.points) * rule.weights
        error2 += np.einsum("mqs,st,mqt,mq->", gap, D, gap, weight)
        energy += np.einsum("mqs,st,mqt,mq->", exact, D, exact, weight)
        radii[of.degree] = np.hypot(*X[:, :3].mean(axis=1).T)
    return len(found.get("MAILLAGE").nodes), np.sqrt(error2 / energy), str(found.get("ARRET")), radii


@pytest.mark.parametrize("degree", [1, 2])
def test_uniform_meshes_converge_as_h_to_the_degree(degree):
    coarse, fine = (tube(n, degree == 2)[1] for n in (4, 8))
    assert np.log2(coarse / fine) == pytest.approx(degree, abs=0.12)


def test_raising_every_element_gives_the_uniform_quadratic_solution():
    nodes, error, stop, radii = tube(2, wanted=1e-6, changes=4)
    assert stop == "STAGNATION"
    assert len(radii[1]) == 0
    uniform = tube(2, quadratic=True)
    assert nodes == uniform[0]
    assert error == pytest.approx(uniform[1], rel=1e-9)


def test_raising_where_it_pays_needs_fewer_unknowns_than_everywhere():
    nodes, error, stop, radii = tube(4, wanted=0.1, changes=5)
    assert stop == "ATTEINT"
    assert error < 0.1
    # the same mesh with every element of the second degree, and linear ones on any uniform mesh
    assert nodes < 0.6 * tube(4, quadratic=True)[0]
    linear_nodes, linear_error, _, _ = tube(8)
    assert nodes < 0.5 * linear_nodes * (linear_error / error) ** 2
    # near the hole, where the stress bends
    assert radii[2].mean() < 0.7 * radii[1].mean()
