"""Matrices, strains and forces of the zones of a model: which kernel serves solids, bodies of revolution and bars."""

from __future__ import annotations

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import bars, elasticity, geometry
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.failures import worded
from gibiane_ops.values.material import elastic_law
from gibiane_ops.values.modele import DISPLACEMENTS, ModelZone
from gibiane_ops.values.nodes import FloatArray, node_store


def corners(ctx: Context, zone: ModelZone) -> FloatArray:
    """Return the coordinates of the nodes of the elements, (m, n, d), length."""
    return np.asarray(node_store(ctx).coords[zone.cells][..., : zone.dim], np.float64)


def checked_corners(ctx: Context, zone: ModelZone) -> FloatArray:
    """Return the coordinates of the nodes of the elements, once they are known to have positive jacobians."""
    x = corners(ctx, zone)
    if not zone.bars:
        with worded(ctx, at="model"):
            geometry.check_cells(shape(zone.shape), x)
    return x


def stiffness(ctx: Context, zone: ModelZone, material: MChaml) -> FloatArray:
    """Return the stiffness matrices of the elements, (m, n d, n d)."""
    law = elastic_law(ctx, material, zone, "material")
    with worded(ctx, at="model"):
        if zone.bars:
            return bars.bar_stiffness(shape(zone.shape), corners(ctx, zone), law)
        return elasticity.element_stiffness(shape(zone.shape), corners(ctx, zone), law, axisymmetric=zone.axisymmetric)


def strains(ctx: Context, zone: ModelZone, u: ChPoint, *, quadratic: bool = False) -> FloatArray:
    """Return the strains of a displacement field at the stress points, (m, q, c); error 181 without a component.

    `quadratic` adds the terms of second order (Green and Lagrange).
    """
    names = DISPLACEMENTS[zone.family]
    if not set(names) & set(u.names):
        ctx.fail(
            181,
            "the field has no displacement ({wanted}); it has {known}",
            at="u",
            wanted=" ".join(names),
            known=" ".join(u.names) or "no component",
        )
    of = shape(zone.shape)
    x, xi = corners(ctx, zone), of.gauss[0]
    nodal = u.table(names, zone.cells.ravel()).reshape(x.shape)
    with worded(ctx, at="model"):
        if zone.bars:
            return bars.bar_strains(of, x, nodal, xi, quadratic=quadratic)
        axis = zone.axisymmetric
        return elasticity.strains(of, x, nodal, xi, axisymmetric=axis, checked=True, quadratic=quadratic)


def internal_forces(ctx: Context, zone: ModelZone, stress: FloatArray) -> FloatArray:
    """Return the nodal forces that balance stresses given at the stress points, (m, n, d)."""
    of, x = shape(zone.shape), corners(ctx, zone)
    with worded(ctx, at="model"):
        if zone.bars:
            return bars.bar_forces(of, x, stress)
        return elasticity.internal_forces(of, x, stress, axisymmetric=zone.axisymmetric)
