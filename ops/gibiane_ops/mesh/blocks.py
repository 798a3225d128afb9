"""PAVE: a volume of cubes between six faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE
from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.mesh import blocks
from gibiane_ops.mesh.building import dimension, explained, new_mesh, nodes_of
from gibiane_ops.mesh.degree import finished, linear_mesh, wants_quadratic
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.middles import middles_of

PAVE = operator(
    "PAVE",
    topic="mesh",
    summary="volume of cubes between six faces",
    notice="`V = PAVE S1 S2 S3 S4 S5 S6`: faces of quadrangles in rows and columns (DALL), opposite ones after one "
    "another, S1 with S2, S3 with S4, S5 with S6; opposite faces are meshed alike, and the faces share the nodes of "
    "their edges (ELIM). Inside, the nodes follow the faces. Faces 1 (S1), 2 (S2) and 3 (the others) are recorded: "
    "see FACE.",
    example="OPTI DIME 3 ELEM QUA4 ; S1 = (DROIT 2 (0. 0. 0.) (1. 0. 0.)) TRAN 2 (0. 1. 0.) ; Z = 0. 0. 1. ; "
    "L1 L2 L3 L4 = COTE S1 ; S2 = S1 PLUS Z ; A1 = L1 TRAN 3 Z ; A2 = L2 TRAN 3 Z ; A3 = L3 TRAN 3 Z ; "
    "A4 = L4 TRAN 3 Z ; ELIM (S1 ET S2 ET A1 ET A2 ET A3 ET A4) 1.E-6 ; V = PAVE S1 S2 A1 A3 A2 A4 ; MESS (MESU V) ;",
    see=["DALLER", "VOLUME"],
)


@PAVE.form(*[Arg(f"s{i}", MAILLAGE, "face") for i in range(1, 7)], gives=[MAILLAGE])
def _pave(ctx: Context, s1: Maillage, s2: Maillage, s3: Maillage, s4: Maillage, s5: Maillage, s6: Maillage) -> Maillage:
    if dimension(ctx) != 3:
        ctx.fail(34, "volumes exist in three dimensions only", hint="OPTI DIME 3 ELEM CUB8 ;")
    given = (s1, s2, s3, s4, s5, s6)
    quadratic = wants_quadratic(ctx, *given)
    faces = [linear_mesh(ctx, face) for face in given]
    for number, face in enumerate(faces, 1):
        if face.shapes != ["QUA4"] or len(blocks.corners(face.cells("QUA4"))) != 4:
            ctx.fail(
                16,
                "face {number} is not a grid of quadrangles with four corners: it holds {shapes}",
                at=f"s{number}",
                number=number,
                shapes=" ".join(face.shapes) or "no element",
                hint="DALL makes such faces",
            )
    ids = _hull(ctx, [face.cells("QUA4") for face in faces])
    return finished(ctx, _filled(ctx, ids, quadratic), quadratic)


def _hull(ctx: Context, faces: Sequence[IntArray]) -> IntArray:
    """Return the nodes of the six faces in a block, (nw + 1, nv + 1, nu + 1), -1 inside."""
    start = faces[0][0]
    corners = blocks.corners(faces[0])
    origin = int(corners[0])
    # Of the three other corners the first that ends a side with the origin.
    bottom = next((g for c in corners[1:] if (g := blocks.grid(faces[0], origin, int(c))) is not None), None)
    if bottom is None:
        _unlike(ctx, 1, start)
    a, b, c, d = (int(n) for n in (bottom[0, 0], bottom[0, -1], bottom[-1, -1], bottom[-1, 0]))
    found: dict[tuple[int, int], IntArray] = {}
    for number, cells in enumerate(faces[2:], 3):
        side = next((s for s in ((a, b), (b, c), (d, c), (a, d)) if np.isin(s, blocks.corners(cells)).all()), None)
        raised = None if side is None or side in found else blocks.grid(cells, *side)
        if side is None or raised is None:
            _unlike(ctx, number, cells[0])
        found[side] = raised
    front, right, back, left = (found[side] for side in ((a, b), (b, c), (d, c), (a, d)))
    height = len(front)
    for number, (side, each) in enumerate(found.items(), 3):
        if len(each) != height:
            _unlike(ctx, number, np.array(side))
    top = blocks.grid(faces[1], int(front[-1, 0]), int(front[-1, -1]))
    if top is None or top.shape != bottom.shape:
        _unlike(ctx, 2, faces[1][0])
    ids = np.full((height, *bottom.shape), -1, np.int64)
    ids[0], ids[-1] = bottom, top
    for number, (where, face) in enumerate(
        (((slice(None), 0), front), ((slice(None), -1), back), ((slice(None), slice(None), 0), left)), 3
    ):
        _placed(ctx, ids, where, face, number)
    _placed(ctx, ids, (slice(None), slice(None), -1), right, 6)
    return ids


def _placed(ctx: Context, ids: IntArray, where: Any, face: IntArray, number: int) -> None:
    """Put a face in the block; the edges that are there must agree."""
    known = ids[where]
    if known.shape != face.shape or (known[known >= 0] != face[known >= 0]).any():
        _unlike(ctx, number, face.ravel())
    ids[where] = face


def _unlike(ctx: Context, number: int, nodes: IntArray) -> NoReturn:
    place = nodes_of(ctx).coords[nodes[0]]
    ctx.fail(
        35,
        "face {number} does not fit the others, near ({place})",
        number=number,
        place=", ".join(f"{x:.6g}" for x in place),
        at=f"s{number}",
        hint="opposite faces are meshed alike and share the nodes of their edges with the others: ELIM joins them",
    )


def _filled(ctx: Context, ids: IntArray, quadratic: bool) -> Maillage:
    """Make the nodes inside a block, and its cubes."""
    store = nodes_of(ctx)
    step = 2 if quadratic else 1
    if quadratic:
        ids = _with_middles(ctx, ids)
    hull: FloatArray = np.where((ids >= 0)[..., None], store.coords[ids], np.nan)
    places = blocks.inside(hull)
    odd = np.indices(ids.shape) % 2
    new = (ids < 0) & (not quadratic or odd.sum(axis=0) <= 1)
    if new.any():
        ids[new] = store.add(places[new], float(store.density[ids[ids >= 0]].mean()))
    if quadratic:
        for axis in range(3):
            line = np.moveaxis(ids, axis, 0)[:, ::2, ::2]
            ends = np.stack([line[:-1:2].ravel(), line[2::2].ravel()], axis=1)
            middles_of(ctx).record(ends, line[1::2].ravel())
    corner = ids[::step, ::step, ::step]
    if _turns(store.coords, corner):
        corner = corner[:, ::-1]
    i, j = slice(None, -1), slice(1, None)
    cells = np.stack([corner[w, v, u] for w in (i, j) for v, u in ((i, i), (i, j), (j, j), (j, i))], axis=-1).reshape(
        -1, 8
    )
    with explained(ctx, "s1"):
        geometry.check_cells(shape("CUB8"), store.coords[cells])
    faces = {
        "1": new_mesh(ctx, [("QUA4", _quads(corner[0].T))]),
        "2": new_mesh(ctx, [("QUA4", _quads(corner[-1]))]),
        "3": new_mesh(
            ctx,
            [
                (
                    "QUA4",
                    np.concatenate(
                        [
                            _quads(corner[:, 0]),
                            _quads(corner[:, -1].T),
                            _quads(corner[:, :, 0].T),
                            _quads(corner[:, :, -1]),
                        ]
                    ),
                )
            ],
        ),
    }
    return new_mesh(ctx, [("CUB8", cells)], faces)


def _quads(grid: IntArray) -> IntArray:
    return np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)


def _turns(x: FloatArray, corner: IntArray) -> bool:
    """Say whether the axes of a block are left-handed, by the volume of its corners."""
    first = corner[0, 0, 0]
    edges = [x[corner[0, 0, -1]] - x[first], x[corner[0, -1, 0]] - x[first], x[corner[-1, 0, 0]] - x[first]]
    return bool(np.linalg.det(np.array(edges)) < 0)


def _with_middles(ctx: Context, ids: IntArray) -> IntArray:
    """Double the block: mid-nodes of the edges of the faces between their corners, -1 elsewhere."""
    fine = np.full([2 * n - 1 for n in ids.shape], -1, np.int64)
    fine[::2, ::2, ::2] = ids
    middles = middles_of(ctx)
    for axis in range(3):
        line = np.moveaxis(fine, axis, 0)[:, ::2, ::2]
        ends = np.stack([line[:-1:2], line[2::2]], axis=-1)
        on_face = np.zeros(ends.shape[:-1], bool)
        on_face[:, [0, -1]] = on_face[:, :, [0, -1]] = True
        values = np.full(ends.shape[:-1], -1, np.int64)
        values[on_face] = middles.of(ends[on_face])
        np.moveaxis(fine, axis, 0)[1::2, ::2, ::2] = values
    return fine
