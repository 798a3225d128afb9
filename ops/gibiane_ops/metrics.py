"""TAILLE 'METRIQUE': sizes that depend on the direction, from the second derivatives of a field."""

from __future__ import annotations

import numpy as np

from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import CHPOINT, FLOTTANT, MMODEL
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.adapt.metric import hessians, metric_map
from gibiane_ops.values.champs import DIFFUS, ChPoint
from gibiane_ops.values.failures import worded
from gibiane_ops.values.material import solid_zones
from gibiane_ops.values.modele import Modele
from gibiane_ops.values.nodes import node_store

TAIL = extend("TAILLE")

SIMPLEX = {2: "TRI3", 3: "TET4"}
"""Elements that REMAILLER makes to a metric."""


@TAIL.form(
    Key("METRIQUE", "sizes by direction, from the second derivatives of a field", required=True),
    Arg("u", CHPOINT, "field whose error counts (displacement, temperature)"),
    Arg("model", MMODEL, "model of TRI3 or TET4, also of second degree"),
    Key("NBMA", "number of elements (needed)", Arg("n", FLOTTANT)),
    Key("MINI", "smallest size", Arg("h1", FLOTTANT)),
    Key("MAXI", "largest size", Arg("h2", FLOTTANT)),
    Key("ALLO", "largest ratio of the sizes of an element (100)", Arg("r", FLOTTANT)),
    Key("GRAD", "growth of sizes from an element to the next (1.5)", Arg("g", FLOTTANT)),
    gives=[CHPOINT],
)
def _metric(
    ctx: Context,
    metrique: bool,
    u: ChPoint,
    model: Modele,
    nbma: float | None,
    mini: float | None,
    maxi: float | None,
    allo: float | None,
    grad: float | None,
) -> ChPoint:
    zones = solid_zones(ctx, model)
    dim = zones[0].dim
    blocks = topology.corner_blocks([(z.shape, z.cells) for z in zones])
    if {name for name, _ in blocks} != {SIMPLEX.get(dim)}:
        ctx.fail(
            16,
            "a mesh of {wanted} is wanted, this one holds {shapes}",
            at="model",
            wanted=SIMPLEX.get(dim, "TRI3"),
            shapes=" ".join(sorted({z.shape for z in zones})),
            hint="CHAN {wanted} cuts other elements",
        )
    if nbma is None:
        ctx.fail(7, "the number of elements is missing", hint="as in 'NBMA' 5000")
    store = node_store(ctx)
    nodes = np.unique(np.concatenate([c.ravel() for _, c in blocks]))
    local = [(name, np.searchsorted(nodes, c)) for name, c in blocks]
    points = store.coords[nodes][:, :dim]
    names = [name for name in u.names if name != "LX"]
    for name in names:
        if len(np.setdiff1d(nodes, u.parts[name][0])):
            ctx.fail(
                181,
                "the field has no {name} at {count} of {total} nodes",
                at="u",
                name=name,
                count=len(np.setdiff1d(nodes, u.parts[name][0])),
                total=len(nodes),
            )
    values = np.stack([u.at(name, nodes) for name in names], axis=1)
    with worded(ctx, at="u"):
        found = metric_map(
            points,
            local,
            hessians(points, local, values),
            nbma,
            smallest=mini or 0.0,
            largest=np.inf if maxi is None else maxi,
            stretch=100.0 if allo is None else allo,
            growth=1.5 if grad is None else grad,
        )
    parts = {f"G{i + 1}{j + 1}": (nodes, found[:, i, j].copy()) for i in range(dim) for j in range(i + 1)}
    return ChPoint(store, parts, DIFFUS)
