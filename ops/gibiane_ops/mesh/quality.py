"""INDI: the quality of the elements of a mesh."""

from __future__ import annotations

from gibiane.forms import Arg, Key
from gibiane.registry import Context, operator
from gibiane.values import MAILLAGE
from gibiane_ops.kernels.mesh import quality
from gibiane_ops.mesh.building import nodes_of
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import ModelZone

INDI = operator(
    "INDI",
    topic="mesh",
    summary="quality of the elements of a mesh",
    notice="Of TRI3 or TET4, as a MCHAML with one value per element, or as a LISTREEL with that word: 'TOPO' from 0 "
    "(flat) to 1 (equilateral); 'ASPE' the longest edge over the smallest height, 1 when equilateral; 'SKEW' from 0 "
    "(equilateral) to 1 (flat).",
    example="OPTI DIME 2 ; T = MANU TRI3 (0. 0.) (1. 0.) (0.5 0.8) ; L = INDI 'TOPO' T 'LISTREEL' ; MESS (MINI L) ;",
    see=["MAILLER", "REMAILLER"],
)
MEASURES = {"TOPO": quality.mean_ratio, "ASPE": quality.aspect, "SKEW": quality.skewness}


@INDI.form(
    Key(tuple(MEASURES), "which measure", name="which", required=True),
    Arg("g", MAILLAGE, "mesh"),
    Key("LISTREEL", "values as a list", name="listed"),
    gives=["MCHAML|LISTREEL"],
)
def _indi(ctx: Context, which: str, g: Maillage, listed: bool) -> MChaml | ListReel:
    block = g.single()
    if block is None or block.shape not in ("TRI3", "TET4"):
        ctx.fail(
            16,
            "a mesh of TRI3 or TET4 is wanted, this one holds {shapes}",
            at="g",
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN {wanted} cuts other elements",
            wanted="TRI3",
        )
    values = MEASURES[which](nodes_of(ctx).coords[block.cells])
    if listed:
        return ListReel(values)
    zone = ModelZone(Maillage(g.store, [block]), "", (), str(ctx.option("MODE")))
    return MChaml([ChamZone(zone, [which], values[:, None, None])], "SCALAIRE", "GRAVITE")
