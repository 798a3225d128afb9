"""TAILLE: sizes of elements, present or wanted."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MCHAML, MMODEL
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.adapt.diameters import smallest_lengths
from gibiane_ops.kernels.adapt.orders import fitted_orders, singular_nodes, singular_orders
from gibiane_ops.kernels.adapt.sizes import size_map
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.topology import corner_blocks, places_in, used_nodes
from gibiane_ops.values.algebra import SCAL
from gibiane_ops.values.champs import DIFFUS, ChamZone, ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.material import MATERIAL, solid_zones
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import FloatArray, node_store
from gibiane_ops.values.results import wanted_results
from gibiane_ops.values.sizing import coincident, error_map, prescribed, refuse_no_elements

NEARLY = 1.01
"""An error that the smallest size makes larger by less than this is not worth a word."""

TAIL = operator(
    "TAILLE",
    topic="adaptation",
    summary="sizes of elements: present ones, or those of the next mesh",
    notice="`CH = TAILLE 'DIAMETRE_MIN' MODL`: the smallest length of each element (component L). `CHD = TAILLE "
    "'ERREUR' CARTE MODL 'PREC' e0`: the sizes at the nodes of the coarsest mesh expected to have the relative error "
    "e0, from a map of relative errors (ERREUR; its component TOTA, or its only one). 'ORDRE' p is the order of "
    "convergence (if absent 1 for linear elements, 2 for quadratic ones), 'SING' lowers it to 0.5 where the error "
    "peaks, 'AJUS' to what the error around shows; the fewest elements are sought, with 'EGAL' (which implies 'SING') "
    "equal errors of all elements; 'MINI' and 'MAXI' bound the sizes, 'GRAD' their growth (1.5), 'NBMA' the number of "
    "elements; 'MINN' takes at a node the smallest size around it rather than their geometric mean. `CHD NB = TAILLE "
    "...` also gives the number of elements that the sizes ask for, `CHD NB SN = TAILLE ...` the nodes where the error "
    "peaks too (POI1; 'BETA' b: singular from b times the mean density of the error). `CHM = TAILLE 'METRIQUE' U "
    "MODL 'NBMA' n`: the metric (G11 G21 G22, in space G31 G32 G33) of n simplices on which the field U is "
    "interpolated best, long where it varies little; 'ALLO' bounds how long. `CHD MARQ EP (NB) = TAILLE 'DEGRE' CARTE "
    "MODL SIGL (SIG) 'PREC' e0`: "
    "sizes, elements to raise to the second degree (1) or not (0), and the error expected; SIGL is the smoothed "
    "stress, SIG that of the solution, from which what quadratic elements gain is measured (else predicted); "
    "'NBMA' bounds the number of elements, EP is then what they reach; 'SEUL' divides nothing. Nodes at one place in "
    "two solids (contact) get one size.",
    example="""
    OPTI DIME 2 ELEM TRI3 MODE PLAN DEFO ;
    S = (DROI 8 (0. 0.) (4. 0.)) TRAN 2 (0. 1.) ;
    MO = MODE S 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.E5 'NU' 0.3 ;
    U = RESO ((RIGI MO MA) ET (BLOQ 'DEPL' (COTE 4 S))) (FSUR 'MASS' MO (0. -1.) (COTE 2 S)) ;
    X CARTE = ERREUR 'SPR' MO (SIGM MO MA U) MA ; MESS 'error ' X ;
    MESS 'smallest element ' (MINI (TAILLE 'DIAMETRE_MIN' MO)) ;
    CHD NB = TAILLE 'ERREUR' CARTE MO 'PREC' 0.1 'SING' ; MESS 'wanted ' (MINI CHD) ' to ' (MAXI CHD) ', elements ' NB ;
    S2 = REMAILLER S CHD ; MESS 'obtained ' (NBEL S2) ;
    """,
    see=["ERREUR", "REMAILLER"],
)


@TAIL.form(
    Key("DIAMETRE_MIN", "smallest length of each element", required=True, name="diameter"),
    Arg("model", MMODEL, "model"),
    Arg("cara", MCHAML, "geometry of shells and beams", optional=True),
    gives=[MCHAML],
)
def _smallest(ctx: Context, diameter: bool, model: Modele, cara: MChaml | None) -> MChaml:
    coords = node_store(ctx).coords
    zones = [
        ChamZone(z, ["L"], smallest_lengths(shape(z.shape), coords[z.cells][..., : z.dim])[:, None, None])
        for z in solid_zones(ctx, model)
    ]
    return MChaml(zones, MATERIAL, "GRAVITE")


@TAIL.form(
    Key("ERREUR", "sizes for a prescribed error", required=True),
    Arg("carte", MCHAML, "map of relative errors"),
    Arg("model", MMODEL, "model"),
    Key("PREC", "prescribed relative error (needed)", Arg("e0", FLOTTANT)),
    Key("ORDRE", "order of convergence", Arg("p", FLOTTANT)),
    Key("SING", "order 0.5 where the error peaks"),
    Key("AJUSTE", "order fitted where the error peaks", name="fit"),
    Key("EGAL", "equal errors of all elements, not the fewest elements", name="equal"),
    Key(
        "BETA",
        "error density around a node, over that of the whole, from which it is singular (3 in space with linear "
        "elements, else 2)",
        Arg("b", FLOTTANT),
    ),
    Key("MINI", "smallest size", Arg("h1", FLOTTANT)),
    Key("MAXI", "largest size", Arg("h2", FLOTTANT)),
    Key("GRAD", "growth of sizes from a node to the next", Arg("g", FLOTTANT)),
    Key("NBMA", "largest number of elements", Arg("n", FLOTTANT)),
    Key("MINN", "smallest size around a node, not the geometric mean"),
    gives=[CHPOINT, "(FLOTTANT)", "(MAILLAGE)"],
)
def _wanted(
    ctx: Context,
    erreur: bool,
    carte: MChaml,
    model: Modele,
    prec: float | None,
    ordre: float | None,
    sing: bool,
    fit: bool,
    equal: bool,
    beta: float | None,
    mini: float | None,
    maxi: float | None,
    grad: float | None,
    nbma: float | None,
    minn: bool,
) -> Any:
    prec = prescribed(ctx, prec)
    refuse_no_elements(ctx, nbma)
    store = node_store(ctx)
    zones = solid_zones(ctx, model)
    error = error_map(ctx, carte, zones)
    nodes = used_nodes([z.cells for z in zones])
    points = store.coords[nodes][:, : zones[0].dim]
    blocks = [(z.shape, places_in(nodes, z.cells)) for z in zones]
    degrees = np.concatenate([np.full(len(z.cells), float(shape(z.shape).degree)) for z in zones])
    order: float | FloatArray = ordre if ordre is not None else degrees if np.ptp(degrees) else float(degrees[0])
    if beta is None:
        # Peaks of linear solid elements are sharper than those of plane or quadratic ones.
        beta = 3.0 if zones[0].dim == 3 and degrees.max() == 1 else 2.0
    elif not beta > 0:
        ctx.fail(41, "BETA is a ratio of error densities: {value} cannot be one", at="beta", value=beta)
    with worded(ctx, at="prec"):
        measures = np.concatenate([geometry.measures(shape(n), points[c]) for n, c in blocks])
        if sing or fit or equal:
            if fit:
                order = fitted_orders(points, blocks, error**2, measures, order, beta=beta)[0]
            else:
                order = singular_orders(len(points), blocks, error**2, measures, order, beta=beta)
        found = size_map(
            points,
            blocks,
            error,
            prec,
            order=order,
            equal=equal,
            smallest=mini or 0.0,
            largest=np.inf if maxi is None else maxi,
            growth=1.5 if grad is None else grad,
            max_count=nbma,
            smallest_of_star=minn,
            pairs=coincident(points),
        )
    if nbma is not None and found.optimum > nbma:
        reachable = prec * (found.optimum / nbma) ** (float(np.mean(order)) / zones[0].dim)
        ctx.warn(
            "G410",
            "an error of {wanted} needs about {count} elements; with {limit} about {reachable} is reached",
            level=0,
            wanted=f"{prec:.4g}",
            count=round(found.optimum),
            limit=round(nbma),
            reachable=f"{reachable:.3g}",
        )
    elif found.reachable > NEARLY * prec:
        ctx.warn(
            "G410",
            "an error of {wanted} needs smaller elements than {limit}; with these about {reachable} is reached",
            level=0,
            wanted=f"{prec:.4g}",
            limit=f"{mini:.4g}",
            reachable=f"{found.reachable:.3g}",
        )
    field = ChPoint(store, {SCAL: (nodes, found.nodal)}, DIFFUS)
    if wanted_results(ctx) < 3:
        return (field, float(found.count)) if wanted_results(ctx) > 1 else field
    corners = corner_blocks(blocks)
    peak = np.flatnonzero(singular_nodes(len(points), corners, error**2, measures, beta))
    return field, float(found.count), Maillage.of(store, "POI1", nodes[peak][:, None])


@TAIL.form(
    Key("DIRECTION", "size tensors", required=True),
    Arg("model", MMODEL, "model"),
    Key("UNIF", "null tensors"),
    gives=[MCHAML],
)
def _tensors(ctx: Context, direction: bool, model: Modele, unif: bool) -> None:
    ctx.fail(251, "TAILLE 'DIRECTION' is not available yet", at="direction")
