"""REMAILLER: a new mesh of the same domain, of other sizes, with its groups."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE, MCHAML, TABLE, Table
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt.sizes import element_sizes, predicted_count
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import MeshingFailed
from gibiane_ops.kernels.mesh import quality, unions
from gibiane_ops.mesh.building import dimension, explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import finished, is_quadratic, linear_mesh
from gibiane_ops.mesh.filling import fill_contour, fill_envelope
from gibiane_ops.mesh.groups import Groups
from gibiane_ops.mesh.local import divide, move_nodes
from gibiane_ops.mesh.wanted import metric_at, refuse_too_many, sizes_at
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.maillage import Maillage

FLAT = 0.05
"""Mean ratio (INDI 'TOPO') below which an element is told to be nearly flat: a regular one has 1."""

NEAR_ENOUGH = 0.05
"""Relative difference of the number of elements below which a mesh whose boundary is kept is left as it is."""

REMA = operator(
    "REMAILLER",
    topic="mesh",
    summary="new mesh of the same domain with other sizes",
    notice="`M2 = REMAILLER M1 size` meshes the domain of M1 (TET4 in space, TRI3 in the plane) again; size is a "
    "FLOTTANT or a CHPOINT on M1, of component SCAL (edge length) or G (its square inverse), or a metric "
    "G11 G21 G22 (in space G31 G32 G33 too) of TAILLE 'METRIQUE': elements are then long where it says so; Mmg makes "
    "them (`pip install gibiane[mmg]`; a plane is meshed without it too, but not quite the same twice). Corners, plane "
    "faces and straight edges are kept exactly, curved faces follow the old facets. "
    "`M2 T2 = REMAILLER M1 size 'GROU' T1`: the "
    "MAILLAGE in the table T1 (parts of M1, of its boundary, of edges, points) are found again on M2 under the same "
    "indices. Index PAIRES of T1, a table of tables (1: face of the second body, 2: face of the first), names contact "
    "faces that are meshed once and duplicated, so that their nodes still pair. With 'SOUC' a failure is a warning "
    "and M1 is returned. `M2 = REMAILLER M1 BORD size` keeps the whole boundary BORD (ENVE M1, CONT M1) as it is, "
    "node for node. 'LOCA' divides elements in place and puts them together again where the sizes allow: TRI3 and "
    "TET4 are halved, without hanging nodes; QUA4 and CUB8 are cut in 4 or 8, and RELA MODL holds their hanging "
    "nodes. Contact pairs are divided alike (QUA4, CUB8: all the elements of a contact). The table given back holds "
    "under ARBRE what coarsening needs; the mesh gets about as many elements as the sizes ask for on the whole, so "
    "that sizes that vary much within an element change little at a time. `M2 T2 = REMAILLER M1 MARQ 'GROU' T1`, also "
    "with a size and 'LOCA': elements where the field MARQ exceeds 0.5 become quadratic, others linear; at a contact "
    "(PAIRES) the partner rises too, and their mid-nodes pair; RELA MODL ties the mid-nodes beside linear elements. "
    "`M2 T2 = REMAILLER M1 'DEPL' V 'GROU' T1`: the same elements on new nodes, "
    "moved by the field V. Meshes of second degree get mid-nodes again; on the boundary they are those of "
    "new straight edges, unless it is kept.",
    example="""
    OPTI DIME 2 ELEM TRI3 MODE PLAN DEFO ; S = (DROI 4 (0. 0.) (1. 0.)) TRAN 4 (0. 1.) ;
    S2 = REMAILLER S 0.1 ; MESS 'triangles of side 0.1: ' (NBEL S2) ;
    TG = TABL ; TG.'BAS' = COTE 1 S ; TG.'COIN' = S POIN 'PROC' (0. 0.) ;
    CHD = 0.03 + (0.3 * (((COOR 1 S) ** 2) + ((COOR 2 S) ** 2))) ;
    S3 T3 = REMAILLER S CHD 'GROU' TG ;
    MESS 'small ones at the corner: ' (NBEL S3) ', on the side BAS ' (NBEL (T3.'BAS')) ;
    S4 T4 = REMAILLER S CHD 'GROU' TG 'LOCA' ; MESS 'divided in place: ' (NBEL S4) ;
    S5 T5 = REMAILLER S4 1. 'GROU' T4 'LOCA' ; MESS 'put together again: ' (NBEL S5) ;
    """,
    see=["MAILLER", "TAILLE"],
)

SIZE = Arg("size", (FLOTTANT, CHPOINT), "edge length, or field of sizes")
SOUC = Key("SOUCI", "a failure is a warning")


def _remesh(
    ctx: Context, g: Maillage, size: float | ChPoint, grou: Table | None, souci: bool
) -> tuple[Maillage, Table]:
    from gibiane_ops.kernels.remesh import remesh

    dim = dimension(ctx)
    wanted = {2: "TRI3", 3: "TET4"}.get(dim)
    quadratic, old = is_quadratic(g), g
    g = linear_mesh(ctx, g)
    block = g.single()
    if block is None or block.shape != wanted:
        ctx.fail(
            16,
            "a mesh of {wanted} is wanted, this one holds {shapes}",
            at="g",
            wanted=wanted,
            shapes=" ".join(g.shapes) or "no element",
            hint="ELEM '{wanted}' takes them alone"
            if set(g.shapes) <= {wanted, "POI1", "SEG2", "TRI3"}
            else "CHAN {wanted} cuts other elements",
        )
    store = nodes_of(ctx)
    nodes = g.nodes
    metric = metric_at(ctx, size, nodes, dim)
    sizes = sizes_at(ctx, size, nodes) if metric is None else metric
    equal = sizes if metric is None else np.linalg.det(metric) ** (-0.5 / dim)
    points, cells = store.coords[nodes][:, :dim], np.searchsorted(nodes, block.cells)
    refuse_too_many(ctx, points, [(wanted, cells)], np.asarray(equal, np.float64))
    groups = Groups(ctx, grou if grou is not None else Table(), nodes)
    with explained(ctx, "g"):
        try:
            result = remesh(
                points,
                cells,
                np.asarray(sizes, np.float64),
                groups=groups.cells,
                pairs=groups.pairs,
            )
        except MeshingFailed as failure:
            if not souci:
                raise
            ctx.warn(27, "no new mesh could be made, the old one is kept: {reason}", at="g", reason=failure.reason)
            return old, grou if grou is not None else Table()
    from scipy.spatial import cKDTree

    _, near = cKDTree(points).query(result.points)
    ids = store.add(result.points, store.density[nodes][near])
    if metric is None:
        _warn_flat(ctx, result.points, result.cells)
    mesh = finished(ctx, new_mesh(ctx, [(wanted, ids[result.cells])]), quadratic)
    return mesh, groups.renewed(result.groups, ids)


def _warn_flat(ctx: Context, points: FloatArray, cells: IntArray) -> None:
    """Tell of the elements that the mesher and its optimisation left nearly flat, with the place of the worst."""
    ratio = quality.mean_ratio(points[cells])
    flat = np.flatnonzero(ratio < FLAT)
    if not len(flat):
        return
    worst = flat[np.argsort(ratio[flat], kind="stable")]
    ctx.warn(
        "G419",
        "{count} elements of the new mesh are nearly flat: {which}; the worst, of quality {least}, is at ({place})",
        at="g",
        count=len(flat),
        which=" ".join(str(k + 1) for k in worst[:5].tolist()) + (" ..." if len(worst) > 5 else ""),
        least=f"{ratio[worst[0]]:.3g}",
        place=" ".join(f"{x:.4g}" for x in points[cells[worst[0]]].mean(axis=0)),
        hint="smaller sizes where the domain is thin; INDI 'TOPO' shows the quality of each element",
    )


@REMA.form(
    Arg("g", MAILLAGE, "mesh"),
    SIZE,
    Key("GROUPES", "table of groups", Arg("t", TABLE), required=True, name="grou"),
    SOUC,
    Key("LOCAL", "elements divided and put together in place"),
    Arg("marks", MCHAML, "elements of second degree (above 0.5), with 'LOCA'", optional=True),
    gives=[MAILLAGE, TABLE],
)
def _with_groups(
    ctx: Context, g: Maillage, size: float | ChPoint, grou: Table, souci: bool, local: bool, marks: MChaml | None
) -> tuple[Maillage, Table]:
    if local:
        return divide(ctx, g, size, grou, marks)
    return _remesh(ctx, g, size, grou, souci)


@REMA.form(
    Arg("g", MAILLAGE, "mesh"),
    Arg("marks", MCHAML, "elements of second degree (above 0.5)"),
    Key("GROUPES", "table of groups", Arg("t", TABLE), required=True, name="grou"),
    gives=[MAILLAGE, TABLE],
)
def _raised(ctx: Context, g: Maillage, marks: MChaml, grou: Table) -> tuple[Maillage, Table]:
    return divide(ctx, g, None, grou, marks)


@REMA.form(
    Arg("g", MAILLAGE, "mesh"),
    Key("DEPLACER", "the same elements on moved nodes", required=True, name="moved"),
    Arg("move", CHPOINT, "moves of the nodes (UX UY UZ)"),
    Key("GROUPES", "table of groups", Arg("t", TABLE), required=True, name="grou"),
    gives=[MAILLAGE, TABLE],
)
def _moved(ctx: Context, g: Maillage, moved: bool, move: ChPoint, grou: Table) -> tuple[Maillage, Table]:
    return move_nodes(ctx, g, move, grou)


@REMA.form(Arg("g", MAILLAGE, "mesh"), Arg("bord", MAILLAGE, "its boundary, to be kept"), SIZE, gives=[MAILLAGE])
def _kept_boundary(ctx: Context, g: Maillage, bord: Maillage, size: float | ChPoint) -> Maillage:
    dim = dimension(ctx)
    fill = {2: ("TRI3", "SEG2"), 3: ("TET4", "TRI3")}
    corners, kept = linear_mesh(ctx, g), linear_mesh(ctx, bord)
    if dim not in fill or corners.shapes != [fill[dim][0]]:
        ctx.fail(
            16,
            "a mesh of {wanted} is wanted, this one holds {shapes}",
            at="g",
            wanted=fill.get(dim, ("TRI3",))[0],
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN {wanted} cuts other elements",
        )
    facets = topology.boundary(corners.kernel_blocks)[fill[dim][1]].nodes
    given = kept.cells(fill[dim][1])
    if len(given) != len(facets) or not unions.is_in(facets, given).all():
        ctx.fail(
            251,
            "a part of the boundary cannot be kept alone: {given} of its {total} facets are given",
            at="bord",
            given=int(unions.is_in(facets, given).sum()) if len(given) else 0,
            total=len(facets),
            hint="ENVE (in the plane CONT) gives the whole boundary",
        )
    if _has_these_sizes(ctx, corners, size):
        return g
    mesh = fill_envelope(ctx, facets, size, "g") if dim == 3 else fill_contour(ctx, facets, size, False, "g")
    return finished(ctx, mesh, is_quadratic(g))


def _has_these_sizes(ctx: Context, g: Maillage, size: float | ChPoint) -> bool:
    """Say whether a mesh is what would be made: as many elements within 5 %, each within a factor 2."""
    block = g.blocks[0]
    of = shape(block.shape)
    nodes = g.nodes
    points = nodes_of(ctx).coords[nodes][:, : dimension(ctx)]
    cells = np.searchsorted(nodes, block.cells)
    wanted = np.broadcast_to(np.asarray(sizes_at(ctx, size, nodes), np.float64), len(nodes))
    refuse_too_many(ctx, points, [(block.shape, cells)], wanted)
    present = element_sizes(of, np.abs(geometry.measures(of, points[cells])))
    asked = predicted_count(points, [(block.shape, cells)], wanted)
    ratio = present / wanted[cells].mean(axis=1)
    return bool(abs(len(cells) / asked - 1) <= NEAR_ENOUGH and ratio.min() >= 0.5 and ratio.max() <= 2.0)


@REMA.form(Arg("g", MAILLAGE, "mesh"), SIZE, SOUC, gives=[MAILLAGE])
def _plain(ctx: Context, g: Maillage, size: float | ChPoint, souci: bool) -> Maillage:
    return _remesh(ctx, g, size, None, souci)[0]
