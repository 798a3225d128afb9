"""INDI: the quality of the elements of a mesh."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import CHPOINT, FLOTTANT, MAILLAGE
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.mesh import quality
from gibiane_ops.mesh.building import nodes_of
from gibiane_ops.mesh.degree import linear_mesh
from gibiane_ops.mesh.wanted import Size, metric_at, sizes_at
from gibiane_ops.values.champs import ChamZone, ChPoint, MChaml
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import ModelZone

INDI = operator(
    "INDI",
    topic="mesh",
    summary="quality of the elements of a mesh",
    notice="A MCHAML with one value per element and a component per word, or with 'LISTREEL' a list. 'TOPO' from 0 "
    "(flat) to 1: of triangles and tetrahedra the mean ratio (1 when equilateral); of QUA4, CUB8, PRI6 and PYR5 that "
    "of the worst corner (1 for a square, a cube, a prism of equilateral bases as high as they are wide, a pyramid of "
    "equal edges), 0 when a corner is turned inside out. Of TRI3 and TET4 also 'ASPE', the longest edge over the "
    "smallest height, 1 when equilateral, and 'SKEW' from 0 (equilateral) to 1 (flat); of QUA4 'PLAN', 100 in a "
    "plane, less when bent. Mid-nodes do not count. `INDI 'TOPO' G size`, of TRI3 and TET4: 1 when equilateral and of "
    "the wanted edge length, a FLOTTANT or a CHPOINT as for REMAILLER (SCAL a length, G its square inverse, G11 G21 "
    "G22, in space G31 G32 G33, a metric): the mean ratio in the mean metric of the corners times (s (2 - s))**3, s "
    "being the edge over the wanted length, or its inverse when that is smaller.",
    example="OPTI DIME 2 ; T = MANU TRI3 (0. 0.) (1. 0.) (0.5 0.8) ; L = INDI 'TOPO' T 'LISTREEL' ; MESS (MINI L) ;",
    see=["MAILLER", "REMAILLER"],
)
WORDS = ("TOPO", "ASPE", "SKEW", "PLAN")
KNOWN = {
    "TOPO": ("TRI3", "TET4", *quality.CORNERS),
    "ASPE": ("TRI3", "TET4"),
    "SKEW": ("TRI3", "TET4"),
    "PLAN": ("QUA4",),
}


@INDI.form(
    Key(WORDS, "which measure", name="which", required=True),
    Key(WORDS, "and further ones", name="more", repeat=True),
    Arg("g", MAILLAGE, "mesh"),
    Arg("size", (FLOTTANT, CHPOINT), "wanted edge length, or field of sizes or metrics", optional=True),
    Key("LISTREEL", "values as a list", name="listed"),
    gives=["MCHAML|LISTREEL"],
)
def _indi(ctx: Context, which: str, more: list[str], g: Maillage, size: Size, listed: bool) -> MChaml | ListReel:
    words = list(dict.fromkeys([which, *more]))
    if not g.blocks:
        ctx.fail(26, "there is no element: the mesh is empty", at="g")
    if listed and len(words) > 1:
        ctx.fail(21, "a LISTREEL holds one measure, {count} are asked for", at="g", count=len(words))
    if size is not None and words != ["TOPO"]:
        ctx.fail(21, "only 'TOPO' is measured against a wanted size", at="size", hint="INDI 'TOPO' G SIZE, apart")
    linear = linear_mesh(ctx, g)
    zones = []
    for block, own in zip(linear.blocks, g.blocks, strict=True):
        for word in words:
            known = KNOWN[word] if size is None else ("TRI3", "TET4")
            if block.shape not in known:
                ctx.fail(
                    16,
                    "'{word}' is a measure of {known}; this mesh holds {shapes}",
                    at="g",
                    word=word,
                    known=" ".join(known),
                    shapes=" ".join(g.shapes),
                    hint="CHAN cuts elements, ELEM chooses some",
                )
        x = nodes_of(ctx).coords[block.cells]
        if size is None:
            values = np.stack([_measure(word, block.shape, x, int(ctx.option("DIME"))) for word in words], axis=1)
        else:
            values = _against(ctx, size, block.cells, x)[:, None]
        zone = ModelZone(Maillage(g.store, [own]), "", (), str(ctx.option("MODE")))
        zones.append(ChamZone(zone, words, values[:, None, :]))
    if listed:
        return ListReel(np.concatenate([zone.values.ravel() for zone in zones]))
    return MChaml(zones, "SCALAIRE", "GRAVITE")


def _measure(word: str, name: str, x: FloatArray, dim: int) -> FloatArray:
    if word == "TOPO":
        return quality.corner_ratio(name, x[..., :dim]) if name in quality.CORNERS else quality.mean_ratio(x)
    return {"ASPE": quality.aspect, "SKEW": quality.skewness, "PLAN": quality.flatness}[word](x)


def _against(ctx: Context, size: float | ChPoint, cells: IntArray, x: FloatArray) -> FloatArray:
    """Measure simplices by the mean of the metrics that are wanted at their corners."""
    dim = int(ctx.option("DIME"))
    nodes, ranks = np.unique(cells, return_inverse=True)
    metric = metric_at(ctx, size, nodes, dim)
    if metric is None:
        wanted = np.broadcast_to(np.asarray(sizes_at(ctx, size, nodes)), (len(nodes),))
        metric = wanted[:, None, None] ** -2.0 * np.eye(dim)
    return quality.metric_quality(x[..., :dim], metric[ranks.reshape(cells.shape)].mean(axis=1))
