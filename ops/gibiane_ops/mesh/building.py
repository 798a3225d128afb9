"""What the mesh families share: the options they obey, lines as lists of nodes, failures of kernels in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.mesh import chains, orientation, subdivision
from gibiane_ops.values.failures import worded
from gibiane_ops.values.maillage import COLOURS, Block, Maillage, Point
from gibiane_ops.values.nodes import NodeStore, node_store

TRIANGLES = ("TRI3", "TRI6", "TET4", "TE10", "PRI6", "PR15", "PYR5", "PY13")
SECOND_DEGREE = ("SEG3", "TRI6", "QUA8", "TE10", "PY13", "PR15", "CU20")
LINES = ("SEG2", "SEG3")
SURFACES, VOLUMES = ("TRI3", "QUA4"), ("TET4", "PYR5", "PRI6", "CUB8")
DIMENSION = {name: each.dim for name, each in SHAPES.items()}


def dimension(ctx: Context) -> int:
    """Return the dimension of space.

    Raises
    ------
    GibianeError
        219 when OPTI DIME has not been given.
    """
    dim = int(ctx.option("DIME"))
    if dim == 0:
        ctx.fail(219, "the dimension of space is not set", hint="begin with OPTI DIME 3 ELEM CUB8 ;")
    return dim


def surface_shape(ctx: Context) -> str:
    """Return the linear type of the elements of a new surface: that of OPTI ELEM, or of the faces of that volume."""
    dimension(ctx)
    return "TRI3" if ctx.option("ELEM") in TRIANGLES else "QUA4"


def nodes_of(ctx: Context) -> NodeStore:
    """Return the nodes of the session."""
    return node_store(ctx)


def new_point(ctx: Context, coords: FloatArray) -> Point:
    """Make a point of the current density."""
    store = node_store(ctx)
    return Point(store, int(store.add([coords], ctx.option("DENS"))[0]))


def new_mesh(
    ctx: Context, parts: Sequence[tuple[str, IntArray]], sides: Mapping[str, Maillage] | None = None
) -> Maillage:
    """Make a mesh in the current colour (OPTI COUL)."""
    colour = COLOURS.index(ctx.option("COUL")) if ctx.session.options.get("COUL") else 0
    blocks = [Block(name, cells, np.full(len(cells), colour, np.int64)) for name, cells in parts if len(cells)]
    return Maillage(node_store(ctx), blocks, dict(sides or {}))


def line_segments(ctx: Context, mesh: Maillage, at: str) -> IntArray:
    """Return the ends of the segments of a line, (m, 2).

    Raises
    ------
    GibianeError
        16 when it holds anything but segments of one type.
    """
    block = mesh.single()
    if block is None or block.shape not in LINES:
        shapes = " ".join(mesh.shapes) or "no element"
        ctx.fail(
            16,
            "a line is wanted, this mesh holds {shapes}",
            at=at,
            shapes=shapes,
            label="holds {shapes}",
            hint="COTE and CONT give the lines of a surface",
        )
    return block.cells[:, :2]


def line_nodes(ctx: Context, mesh: Maillage, at: str) -> IntArray:
    """Return the corners along a line; the last equals the first on a closed one.

    Raises
    ------
    GibianeError
        16 when it is no line, 21 when its segments cannot be walked from end to end.
    """
    segments = line_segments(ctx, mesh, at)
    if not chains.is_chain(segments):
        segments = segments[chains.walk(segments)]
        if not chains.is_chain(segments):
            ctx.fail(
                21,
                "this line is in several pieces, or its segments turn different ways",
                at=at,
                label="not one continuous line",
                hint="ET joins lines that follow one another; INVE turns one over",
            )
    return chains.chain_nodes(segments)


def line_between(ctx: Context, nodes: IntArray) -> Maillage:
    """Make the line that joins nodes in order."""
    return new_mesh(ctx, [("SEG2", chains.segments_of(nodes))])


def reversed_mesh(mesh: Maillage) -> Maillage:
    """Turn every element over; lines are also read from their other end."""
    blocks = []
    for block in mesh.blocks:
        cells, colours = orientation.reversed_cells(block.shape, block.cells), block.colours
        if block.shape in LINES:
            cells, colours = cells[::-1], colours[::-1]
        blocks.append(Block(block.shape, cells, colours))
    return Maillage(mesh.store, blocks)


def join(meshes: Sequence[Maillage], sides: Mapping[str, Maillage] | None = None) -> Maillage:
    """Put meshes together as they are: elements of one type in one block, in the order given."""
    by_shape: dict[str, list[Block]] = {}
    for mesh in meshes:
        for block in mesh.blocks:
            by_shape.setdefault(block.shape, []).append(block)
    blocks = [
        Block(name, np.concatenate([b.cells for b in each]), np.concatenate([b.colours for b in each]))
        for name, each in by_shape.items()
    ]
    return Maillage(meshes[0].store, blocks, dict(sides or {}))


def places_along(ctx: Context, length: float, start: float, end: float, count: int | None) -> FloatArray:
    """Subdivide a length by a count or by the sizes wanted at its ends.

    Raises
    ------
    GibianeError
        809 when a size is needed and is not positive, 21 when the length is zero.
    """
    try:
        return subdivision.abscissas(length, start, end, count)
    except BadValue as failure:
        if failure.what == "length":
            ctx.fail(21, "its two ends are at the same place: there is nothing to mesh")
        ctx.fail(
            809,
            "a number of elements or densities are needed: the density here is {value}",
            value=failure.value,
            hint="give a number of elements, or DENS 0.1 ; before the points, or 'DINI' and 'DFIN'",
        )


def tolerance_of(ctx: Context, given: float | None, nodes: Any) -> float:
    """Return a distance below which points are the same: given, a tenth of the density, or small beside the mesh."""
    if given is not None:
        return given
    density = float(ctx.option("DENS"))
    if density > 0:
        return density / 10
    x = nodes_of(ctx).coords[nodes]
    size = 1e-6 * float(np.linalg.norm(np.ptp(x, axis=0))) if len(x) else 0.0
    ctx.warn(
        0,
        "no distance is given and the density is 0: {value} is taken (a millionth of the mesh)",
        value=f"{size:.3g}",
        hint="give a distance, or set DENS",
    )
    return size


def axis_end(ctx: Context, a: Point, b: Point | None) -> FloatArray:
    """Return a second point of the axis of a rotation: in the plane, above the centre."""
    if dimension(ctx) < 3:
        return np.asarray(a.coords + [0.0, 0.0, 1.0], np.float64)
    if b is None:
        ctx.fail(37, "no POINT for the second point of the axis: in space a rotation turns about two points")
    if np.array_equal(a.coords, b.coords):
        ctx.fail(237, "the two points of the axis are at the same place")
    return b.coords


def reference(ctx: Context, g: Maillage, i: int | None, what: str) -> Any:
    """Return a recorded side or face of a mesh, or all of them."""
    if not g.sides:
        ctx.fail(
            24,
            "this mesh has no recorded {what}",
            at="g",
            what=what,
            hint="only the mesh made by one operator has them, not its unions; CONT and ENVE give its boundary",
        )
    if i is None:
        return tuple(g.sides.values())
    if str(i) not in g.sides:
        ctx.fail(
            24,
            "there is no {what} {number}: this mesh has {known}",
            at="i",
            what=what,
            number=i,
            known=" ".join(g.sides),
        )
    return g.sides[str(i)]


CROSSED = ("PLC Error", "overlapping facets", "Invalid boundary mesh")
"""What the mesher says of a boundary that crosses itself."""


@contextmanager
def explained(ctx: Context, at: str | None = None, failed: int = 27) -> Iterator[None]:
    """Turn failures of kernels into diagnostics about operand `at`; `failed` is the number for a mesher's refusal."""
    with worded(ctx, at=at):
        try:
            yield
        except MeshingFailed as failure:
            crossed = any(word in failure.reason for word in CROSSED)
            ctx.fail(
                failed,
                "no mesh could be made: {reason}",
                at=at,
                reason=failure.reason,
                hint="the boundary crosses or touches itself: do solids overlap?" if crossed else "",
            )
