"""ERREUR 'EXAC': the true error of a stress, for verification."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.diagnostics import Text
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import FLOTTANT, MCHAML, MMODEL, MOT, Table
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.truth import exact_error
from gibiane_ops.kernels.estimate.zz import SolidError, true_error
from gibiane_ops.kernels.recovery import StressBlock
from gibiane_ops.kernels.supports import moved
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.estimates import KIND, NORM, TABL, Guarantee, Parts, results
from gibiane_ops.values.failures import worded
from gibiane_ops.values.listes import ListReel
from gibiane_ops.values.material import MATERIAL, STRESS, elastic_compliance, on_zone, solid_zones, told_apart
from gibiane_ops.values.modele import Modele, ModelZone
from gibiane_ops.values.nodes import FloatArray, node_store

ERRE = extend("ERREUR")
EXACT = Guarantee(True, Text("the true error, up to the integration of the exact stress"))
COMMON = (
    Key("EXAC", "true error", required=True),
    Arg("model", MMODEL, "model"),
    Arg("sig", MCHAML, "stress"),
    Arg("mat", MCHAML, "material"),
)


@ERRE.form(
    *COMMON,
    Arg("exact", MCHAML, "exact stress at the nodes, at the points of the mass or at the stress points"),
    KIND,
    NORM,
    TABL,
    gives=[FLOTTANT, MCHAML, "(FLOTTANT)"],
)
def _by_field(
    ctx: Context,
    exac: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    exact: MChaml,
    kind: str | None,
    norm: str | None,
    tabl: bool,
) -> Any:
    given = [("sig", sig), ("mat", mat), ("exact", exact)]
    stress, truth, material = told_apart(ctx, given, STRESS, STRESS, MATERIAL)

    def measured(zone: ModelZone, block: StressBlock, law: FloatArray) -> SolidError:
        values, of = on_zone(ctx, truth, zone, "exact").values, block.shape
        rule = of.mass_rule if truth.support in ("NOEUD", "MASSE") else of.stiffness_rule
        if len(rule.weights) == 1 or values.shape[1] == 1:
            ctx.fail(
                26,
                "one value an element does not show the error of {shape}, whose stress is best at the centre",
                at="exact",
                shape=zone.shape,
                hint="give the exact stress at the nodes (CHAN 'CHAM') or at the points 'MASSE'",
            )
        known = moved(of, values, truth.support, "MASSE" if rule is of.mass_rule else "STRESSES")
        points = node_store(ctx).coords[:, : zone.dim]
        return true_error(points, block, known, rule, law, axisymmetric=zone.axisymmetric)

    return _true(ctx, model, stress, material, measured, kind, norm, tabl)


@ERRE.form(
    *COMMON,
    Key(
        "PROC",
        "name of a procedure T = NAME X Y (Z): coordinates of points, LISTREEL, to a TABLE of LISTREEL of stresses, "
        "T.'SMXX' and so on; those that are absent are zero",
        Arg("name", MOT),
        name="proc",
        required=True,
    ),
    KIND,
    NORM,
    TABL,
    gives=[FLOTTANT, MCHAML, "(FLOTTANT)"],
)
def _by_procedure(
    ctx: Context,
    exac: bool,
    model: Modele,
    sig: MChaml,
    mat: MChaml,
    proc: str,
    kind: str | None,
    norm: str | None,
    tabl: bool,
) -> Any:
    stress, material = told_apart(ctx, [("sig", sig), ("mat", mat)], STRESS, MATERIAL)

    def measured(zone: ModelZone, block: StressBlock, law: FloatArray) -> SolidError:
        def exact(x: FloatArray) -> FloatArray:
            given = ctx.call(proc, *(ListReel(x[:, i]) for i in range(zone.dim)))
            if len(given) != 1 or not isinstance(given[0], Table):
                ctx.fail(26, "the procedure {name} must return one TABLE", at="proc", name=proc)
            values = np.zeros((len(x), len(zone.stresses)))
            for i, name in enumerate(zone.stresses):
                if given[0].has(name):
                    column = given[0].get(name)
                    if not isinstance(column, ListReel) or len(column.values) != len(x):
                        ctx.fail(
                            212,
                            "{name}.'{component}' must be a LISTREEL of {count} values, one a point",
                            at="proc",
                            name=proc,
                            component=name,
                            count=len(x),
                        )
                    values[:, i] = column.values
            return values

        points = node_store(ctx).coords[:, : zone.dim]
        return exact_error(points, block, exact, law, axisymmetric=zone.axisymmetric)

    return _true(ctx, model, stress, material, measured, kind, norm, tabl)


def _true(
    ctx: Context,
    model: Modele,
    stress: MChaml,
    material: MChaml,
    measured: Callable[[ModelZone, StressBlock, FloatArray], SolidError],
    kind: str | None,
    norm: str | None,
    tabl: bool,
) -> Any:
    zones, errors = solid_zones(ctx, model), []
    for zone in zones:
        of = shape(zone.shape)
        raw = moved(of, on_zone(ctx, stress, zone, "sig").values, stress.support, "STRESSES")
        law = elastic_compliance(ctx, material, zone, "mat")
        with worded(ctx, at="model"):
            errors.append(measured(zone, StressBlock(of, zone.cells, raw), law))
    return results(ctx, Parts(zones, errors), kind, norm, tabl, EXACT, None)
