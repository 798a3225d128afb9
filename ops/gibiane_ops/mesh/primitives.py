"""MAILLER for simple solids, their unions and differences, and files of geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.registry import Context, Refused, extend
from gibiane.values import CHPOINT, ENTIER, FLOTTANT, MAILLAGE, MOT, POINT, TABLE, Table
from gibiane_ops.mesh.building import dimension, explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import checked_degree, finished, wants_quadratic
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.middles import middles_of

SIMPLEX = {2: "SEG2", 3: "TRI3", 4: "TET4"}
# How many points each solid wants, and whether a radius follows.
SOLIDS = {"PAVE": (2, False), "CYLI": (2, True), "SPHE": (1, True), "DEMI": (2, True)}
P1, P2, C, N, R = Arg("p1", POINT), Arg("p2", POINT), Arg("c", POINT), Arg("v", POINT), Arg("r", FLOTTANT)


@extend("MAILLER").stream(
    Key("PAVE", "box between two corners (in the plane, rectangle)", P1, P2),
    Key("CYLI", "cylinder: ends of its axis, radius", P1, P2, R),
    Key("SPHE", "ball, or disc in the plane: centre, radius", C, R),
    Key("DEMI", "half of a ball or disc: centre, radius, vector towards the half that is kept", C, R, N),
    Key("FICH", "file of gmsh, STEP or BREP", Arg("name", MOT)),
    Key("UNION", "join the next solid"),
    Key("MOINS", "take the next solid away"),
    Key("ORDRE", "degree of the elements", Arg("n", ENTIER)),
    syntax="'PAVE' p1 p2 | 'CYLI' p1 p2 r | 'SPHE' c r | 'DEMI' c r v | 'FICH' name ('UNION'|'MOINS' solid)... (size) "
    "('ORDRE' n)",
    gives=[MAILLAGE, TABLE],
)
def _solid(ctx: Context, q: Operands) -> Any:
    from gibiane_ops.kernels.remesh.solids import Solid, mesh_file, mesh_solid

    first = q.first_word()
    if first < 0 or str(q.values[first])[:4] not in (*SOLIDS, "FICH"):
        return Refused
    size = q.read(FLOTTANT)
    dim = dimension(ctx)
    if dim == 1:
        ctx.fail(34, "solids exist in two or three dimensions")
    name = q.read_keyword(["FICH"])
    if name is not None:
        path = _path(ctx, q)
        size, degree = _size(ctx, q, size), _degree(ctx, q)
        size = _size(ctx, q, size)
        with explained(ctx):
            return _results(ctx, mesh_file(path, size, dim, degree))
    solids = []
    how: str | None = "UNION"
    while how is not None:
        kind = q.need_keyword([k for k in SOLIDS if dim == 3 or k != "CYLI"])
        count, round_ = SOLIDS[kind]
        points = tuple(q.need(POINT, f"'{kind}'").coords for _ in range(count))
        radius = float(q.need(FLOTTANT, "the radius")) if round_ else 0.0
        solids.append(Solid(kind, points, radius, how))
        how = q.read_keyword(["UNION", "MOINS"])
    size, degree = _size(ctx, q, size), _degree(ctx, q)
    size = _size(ctx, q, size)
    if size is None:
        size = float(ctx.option("DENS"))
        if size == 0:
            ctx.fail(
                809, "no size is given and the density is 0", hint="end with the size of the elements, or set DENS"
            )
    with explained(ctx):
        return _results(ctx, mesh_solid(solids, size, dim, degree))


def _degree(ctx: Context, q: Operands) -> int:
    if q.read_keyword(["ORDRE"]) is None:
        return 2 if wants_quadratic(ctx) else 1
    return checked_degree(ctx, q.need(ENTIER, "the degree"))


def _size(ctx: Context, q: Operands, given: float | None) -> float | None:
    size = q.read(FLOTTANT) if given is None else given
    if size is None and q.read(CHPOINT) is not None:
        ctx.fail(
            251,
            "a field of sizes for a solid that has no mesh yet is not available",
            hint="mesh it with one size, then REMAILLER with the field",
        )
    if size is not None and not size > 0:
        ctx.fail(41, "a size is a length: {value} cannot be one", value=size)
    return None if size is None else float(size)


def _path(ctx: Context, q: Operands) -> Path:
    path = Path(str(q.need(MOT, "the file")))
    if not path.is_file():
        ctx.fail(1130, "the file {path} does not exist", path=path.as_posix())
    return path


def _results(ctx: Context, solid: Any) -> tuple[Maillage, Table]:
    """Return the mesh, and the table of its faces and named groups."""
    store = nodes_of(ctx)
    ids = store.add(solid.points, ctx.option("DENS"))
    quadratic = len(solid.edges) > 0
    if quadratic:
        middles_of(ctx).add(ids[solid.edges], solid.middles)

    def mesh(cells: Any) -> Maillage:
        return finished(ctx, new_mesh(ctx, [(SIMPLEX[cells.shape[1]], ids[np.asarray(cells)])]), quadratic)

    faces, table = Table(), Table()
    for number, face in enumerate(solid.faces, 1):
        faces.set(number, mesh(face))
    table.set("NOMBRE", len(solid.faces))
    table.set("FACE", faces)
    for title, group in solid.named.items():
        table.set(title, mesh(group))
    return mesh(solid.cells), table
