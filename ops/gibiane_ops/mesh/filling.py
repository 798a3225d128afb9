"""Meshes inside a boundary: SURFACE in a contour, VOLUME and MAILLER in an envelope or a contour."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend, operator
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MAILLAGE
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import edges
from gibiane_ops.mesh.building import DIMENSION, dimension, explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import LINEAR, checked_degree, finished, linear_mesh, wants_quadratic
from gibiane_ops.mesh.wanted import Size, sizes_at
from gibiane_ops.values.maillage import Maillage

SIZE = Arg("size", (FLOTTANT, CHPOINT), "size of the elements inside", optional=True)


def numbered(ctx: Context, cells: list[IntArray]) -> tuple[IntArray, list[IntArray]]:
    """Return the nodes of elements, sorted, and the elements by ranks in that list."""
    nodes = np.unique(np.concatenate([each.ravel() for each in cells]))
    return nodes, [np.searchsorted(nodes, each) for each in cells]


def added(ctx: Context, nodes: IntArray, points: FloatArray) -> IntArray:
    """Return ids for the points of a filled mesh: those given first, then new nodes of their mean density."""
    store = nodes_of(ctx)
    inner = points[len(nodes) :]
    new = store.add(inner, float(store.density[nodes].mean())) if len(inner) else np.zeros(0, np.int64)
    return np.concatenate([nodes, new])


def fill_contour(
    ctx: Context, segments: IntArray, size: Size, quadrangles: bool, at: str, frontal: bool = False
) -> Maillage:
    """Mesh the inside of closed plane lines."""
    from gibiane_ops.kernels.remesh import mesh_surface

    nodes, (local,) = numbered(ctx, [segments])
    sizes = sizes_at(ctx, size, nodes)
    dim = dimension(ctx)
    with explained(ctx, at, failed=28):
        x = nodes_of(ctx).coords[nodes][:, :dim]
        filled = mesh_surface(x, local, sizes, quadrangles=quadrangles, frontal=frontal)
    ids = added(ctx, nodes, filled.points)
    return new_mesh(ctx, [("QUA4" if quadrangles else "TRI3", ids[filled.cells]), ("TRI3", ids[filled.rest])])


def fill_envelope(ctx: Context, facets: IntArray, size: Size, at: str, frontal: bool = False) -> Maillage:
    """Mesh the inside of closed surfaces of triangles."""
    from gibiane_ops.kernels.remesh import mesh_volume

    _check_closed(ctx, facets, at)
    nodes, (local,) = numbered(ctx, [facets])
    sizes = sizes_at(ctx, size, nodes)
    with explained(ctx, at):
        filled = mesh_volume(nodes_of(ctx).coords[nodes], local, sizes, frontal=frontal)
    ids = added(ctx, nodes, filled.points)
    return new_mesh(ctx, [("TET4", ids[filled.cells])])


def _check_closed(ctx: Context, facets: IntArray, at: str) -> None:
    loose = edges.contour([("TRI3", facets)], "TOUT")
    if len(loose) == 0:
        return
    a, b = nodes_of(ctx).coords[loose[0]]
    ctx.fail(
        127,
        "the envelope is not closed: {count} edge(s) do not belong to exactly two facets, the first from "
        "({a}) to ({b})",
        at=at,
        count=len(loose),
        a=", ".join(f"{x:.6g}" for x in a),
        b=", ".join(f"{x:.6g}" for x in b),
        label="open, or facets that are there twice",
        hint="ELIM joins surfaces that only touch; CONT shows the open edges",
    )


def lines_of(mesh: Maillage) -> IntArray:
    """Return the segments of a mesh."""
    cells = mesh.cells("SEG2")
    return cells if len(cells) else np.zeros((0, 2), np.int64)


def contour_of(ctx: Context, g: Maillage, at: str) -> IntArray:
    """Return the segments of closed lines, corners only.

    Raises
    ------
    GibianeError
        16 when it holds anything but lines, 28 when they are open.
    """
    g = linear_mesh(ctx, g)
    segments = lines_of(g)
    if len(segments) == 0 or len(g.shapes) > 1:
        ctx.fail(
            16,
            "closed lines are wanted, this mesh holds {shapes}",
            at=at,
            shapes=" ".join(g.shapes) or "no element",
            hint="CONT gives the contour of a surface",
        )
    free = np.flatnonzero(np.bincount(segments.ravel()) % 2)
    if len(free):
        ctx.fail(
            28,
            "the contour is not closed: {count} free end(s), the first at ({place})",
            at=at,
            count=len(free),
            place=", ".join(f"{x:.6g}" for x in nodes_of(ctx).coords[free[0]]),
            label="open",
            hint="ELIM joins ends at one place; DROIT L closes a line",
        )
    return segments


def _envelope(ctx: Context, g: Maillage, at: str) -> IntArray:
    g = linear_mesh(ctx, g)
    facets = g.cells("TRI3")
    if "QUA4" in g.shapes:
        ctx.fail(
            16,
            "this envelope holds quadrangles (QUA4); tetrahedra need triangles",
            at=at,
            hint="CHAN TRI3 cuts quadrangles in two; a surface is swept by VOLU N 'TRAN' V",
        )
    if len(facets) == 0 or len(g.shapes) > 1:
        ctx.fail(
            16,
            "an envelope of triangles is wanted, this mesh holds {shapes}",
            at=at,
            shapes=" ".join(g.shapes) or "no element",
        )
    return facets


@extend("VOLUME").form(
    Arg("s", MAILLAGE, "closed envelope"), SIZE, Key("VERB", "accepted, says nothing more"), gives=[MAILLAGE], last=True
)
def _volume(ctx: Context, s: Maillage, size: Size, verb: bool) -> Maillage:
    return finished(ctx, fill_envelope(ctx, _envelope(ctx, s, "s"), size, "s"), wants_quadratic(ctx, s))


MAILLER = operator(
    "MAILLER",
    topic="mesh",
    summary="mesh of the inside of an envelope or of a closed line",
    whole=True,
    notice="`M = MAILLER ENV (size)` fills a closed surface of triangles with tetrahedra; closed lines in the "
    "same plane are filled with triangles, or with quadrangles if 'ELEM' QUA4 asks for them. The "
    "boundary is kept as it is, node for node; closed parts inside the largest are cavities. The size "
    "inside follows the boundary, a FLOTTANT, or a CHPOINT on the boundary; where the boundary "
    "is much coarser, elements grow towards it. 'ORDRE' 2 gives mid-nodes, on the boundary those of its elements or of "
    "its geometry; so does OPTI ELEM of second degree. 'ALGO' 'FRON' advances from the boundary (regular, but coarse "
    "inside a coarse boundary), 'DELA', the default, inserts points; 'OPTI' is accepted. The same "
    "data give the same mesh. Two bodies that touch: make "
    "the common face once, and use it and its copy `F2 = F1 PLUS (0. 0. 0.)` in the two envelopes; their nodes then "
    "pair exactly. "
    "`M T = MAILLER 'PAVE' P1 P2 size` meshes a box; 'CYLI' P1 P2 r a cylinder, 'SPHE' C r a ball, 'DEMI' C r V "
    "the half of a ball on the side of V (in the plane: rectangle, disc, half disc); 'UNION' or 'MOINS' and another "
    "solid may follow. `M T = MAILLER 'FICH' name (size)` reads a geometry or a mesh of gmsh, STEP or BREP. "
    "T.'NOMBRE' is the number of faces, T.'FACE'. i the mesh of face i, T.'name' a group that the file names.",
    example="OPTI DIME 3 ELEM TRI3 ; S = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; "
    "V = S VOLU 2 'TRAN' (0. 0. 1.) ; E = CHAN TRI3 (ENVE V) ; M = MAILLER E ; MESS (MESU M) ;",
    see=["SURFACE", "VOLUME", "REMAILLER"],
)


@MAILLER.form(
    Arg("g", MAILLAGE, "closed envelope, or closed lines"),
    SIZE,
    Key("ELEM", "type of the elements", Arg("kind", "MOT")),
    Key("ORDRE", "degree of the elements", Arg("n", ENTIER)),
    Key("ALGO", "mesher", Arg("mesher", "MOT", "DELA or FRON")),
    Key("OPTI", "accepted: meshes are always made better at the end"),
    gives=[MAILLAGE],
)
def _mailler(
    ctx: Context, g: Maillage, size: Size, elem: str | None, ordre: int | None, algo: str | None, opti: bool
) -> Maillage:
    mesher = "DELA" if algo is None else algo[:4].upper()
    if mesher not in ("DELA", "FRON"):
        ctx.fail(7, "unknown mesher '{mesher}'; accepted: 'DELA', 'FRON'", at="algo", mesher=mesher)
    frontal = mesher == "FRON"
    flat = max((DIMENSION[name] for name in g.shapes), default=0) == 1
    given = elem[:4] if elem is not None else ("TRI3" if flat else "TET4")
    kind = LINEAR.get(given, given)
    if kind not in (("TRI3", "QUA4") if flat else ("TET4",)):
        ctx.fail(
            19,
            "{kind} elements cannot fill this boundary",
            at="elem",
            kind=kind,
            hint="triangles (TRI3) or quadrangles (QUA4) fill lines, tetrahedra (TET4) fill surfaces",
        )
    degree = checked_degree(ctx, ordre) if ordre is not None else 2 if kind != given or wants_quadratic(ctx, g) else 1
    if flat:
        filled = fill_contour(ctx, contour_of(ctx, g, "g"), size, kind == "QUA4", "g", frontal)
    else:
        filled = fill_envelope(ctx, _envelope(ctx, g, "g"), size, "g", frontal)
    return finished(ctx, filled, degree == 2)
