"""What every estimate of the error returns: relative errors, a map, one TABLE, and whether it is a bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gibiane.diagnostics import Text
from gibiane.forms import Arg, Key
from gibiane.registry import Context
from gibiane.values import FLOTTANT, MCHAML, Table
from gibiane_ops.kernels.estimate.combine import RelativeError, combine
from gibiane_ops.kernels.estimate.effectivity import effectivity
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.values.algebra import SCAL, SCALAIRE
from gibiane_ops.values.champs import ChamZone, MChaml
from gibiane_ops.values.material import MATERIAL, STRESS, on_zone, told_apart
from gibiane_ops.values.modele import ModelZone
from gibiane_ops.values.nodes import FloatArray
from gibiane_ops.values.results import wanted_results

KIND = Key(("ABSOLU", "RELATIF", "LOCAL"), "what the map holds", name="kind")
NORM = Key(
    ("USUEL", "THESE"),
    "relative to the energy plus the error (default), or as in the thesis, which halves the figure",
    name="norm",
)
TABL = Key("TABLE", "all results in one TABLE", name="tabl")
REFE = Key(
    "REFERENCE",
    "with 'TABL': energy of the exact solution, or map of the true error ('EXAC' 'ABSO'); gives THETA and SD",
    Arg("reference", (FLOTTANT, MCHAML)),
    name="refe",
)


READING = {
    "USUE": Text("relative to the energy norm of the solution and of its error"),
    "THES": Text(
        "relative to the norm of smoothed plus computed stress, as in the thesis: about half of the usual figure"
    ),
}


class Guarantee(NamedTuple):
    """Whether an estimate bounds the error from above, and why."""

    holds: bool
    reason: Text


SMOOTHED = Guarantee(False, Text("a smoothed stress estimates the error; only an equilibrated stress bounds it"))


@dataclass(frozen=True, eq=False)
class Parts:
    """Zones of the model with their errors, in one order."""

    zones: list[ModelZone]
    errors: list[SolidError]


def stresses_of(ctx: Context, sig: MChaml, mat: MChaml, smooth: MChaml | None) -> tuple[MChaml, MChaml, MChaml | None]:
    """Tell the stress, the material and the smoothed stress (the one at the nodes) apart."""
    given = [("sig", sig), ("mat", mat), ("smooth", smooth)]
    if smooth is None:
        stress, material = told_apart(ctx, given, STRESS, MATERIAL)
        return stress, material, None
    stress, other, material = told_apart(ctx, given, STRESS, STRESS, MATERIAL)
    return (other, material, stress) if stress.support == "NOEUD" else (stress, material, other)


def field_of(zones: list[ModelZone], values: list[FloatArray]) -> MChaml:
    """Return one value per element as an element field."""
    return MChaml(
        [ChamZone(z, [SCAL], v[:, None, None]) for z, v in zip(zones, values, strict=True)], SCALAIRE, "GRAVITE"
    )


def results(
    ctx: Context,
    parts: Parts,
    kind: str | None,
    norm: str | None,
    tabl: bool,
    guarantee: Guarantee,
    reference: float | MChaml | None,
    more: Mapping[str, Any] | None = None,
) -> Any:
    """Return the relative error, the map and, when asked for, the absolute error; or the TABLE of everything."""
    found = combine(parts.errors, norm="THES" if norm == "THESE" else "USUE")
    if kind == "ABSOLU":
        chosen = [np.sqrt(e.error) for e in parts.errors]
    elif kind == "LOCAL":
        chosen = [np.sqrt(e.error / np.maximum(e.error + e.energy, np.finfo(float).tiny)) for e in parts.errors]
    else:
        chosen = found.solid_map
    field = field_of(parts.zones, chosen)
    if not tabl:
        without_table(ctx, reference)
        return (found.total, field, found.absolute) if wanted_results(ctx) > 2 else (found.total, field)
    table = table_of(ctx, found, parts, field, norm, guarantee)
    for index, value in (more or {}).items():
        table.set(index, value)
    add_quality(ctx, table, parts, found, [e.error for e in parts.errors], reference)
    return table


def without_table(ctx: Context, reference: float | MChaml | None) -> None:
    """Refuse a reference where there is no TABLE to put the quality into."""
    if reference is not None:
        ctx.fail(26, "'REFE' goes with 'TABL': THETA and SD are indices of the table", at="refe")


def add_quality(
    ctx: Context,
    table: Table,
    parts: Parts,
    found: RelativeError,
    squares: Sequence[FloatArray],
    reference: float | MChaml | None,
) -> None:
    """Put THETA and SD into the TABLE of an estimate of known squares where there is a reference."""
    if reference is None:
        return
    if isinstance(reference, MChaml):
        true = [on_zone(ctx, reference, zone, "refe").values[:, 0, 0] ** 2 for zone in parts.zones]
        quality = effectivity(np.concatenate(squares), np.concatenate(true))
        table.set("THETA", quality.theta)
        table.set("SD", quality.deviation)
        return
    left = reference - found.energy
    if left <= 0:
        ctx.fail(
            41,
            "the energy of reference {reference} is not above that of the solution, {energy}",
            at="refe",
            reference=f"{reference:.6g}",
            energy=f"{found.energy:.6g}",
            hint="both are the integral of stress by strain, without 1/2",
        )
    table.set("THETA", found.absolute / float(np.sqrt(left)))


def table_of(
    ctx: Context, found: RelativeError, parts: Parts, field: MChaml, norm: str | None, guarantee: Guarantee
) -> Table:
    """Return the TABLE of an estimate, its sentences in the language of the session."""
    lang = ctx.session.lang
    table = Table()
    for index, value in {
        "GLOBALE": found.total,
        "SOLIDE": found.solid,
        "CONTACT": found.contact,
        "ABSOLUE": found.absolute,
        "ENERGIE": found.energy,
        "NBEL": sum(z.mesh.n_cells for z in parts.zones),
        "NORME": (norm or "USUEL")[:4],
        "LECTURE": READING[(norm or "USUEL")[:4]].render(lang),
        "CARTE": field,
        "GARANTI": guarantee.holds,
        "RAISON": guarantee.reason.render(lang),
    }.items():
        table.set(index, value)
    return table
