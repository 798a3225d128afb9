"""Smoothed stresses: from values at integration points to a continuous field at the nodes of one solid.

Each function works on one solid at a time: a stress is never smoothed across two materials or across a contact.
"""

from gibiane_ops.kernels.recovery.averages import mean_of_centres, mean_of_nodes, nodal_mean, project
from gibiane_ops.kernels.recovery.blocks import Recovered, StressBlock, centre_values, extrapolate
from gibiane_ops.kernels.recovery.enriched import Surface, enriched_recovery
from gibiane_ops.kernels.recovery.methods import METHODS, recover
from gibiane_ops.kernels.recovery.patches import patch_recovery
from gibiane_ops.kernels.recovery.samples import superconvergent_samples, surface_points

__all__ = [
    "METHODS",
    "Recovered",
    "StressBlock",
    "Surface",
    "centre_values",
    "enriched_recovery",
    "extrapolate",
    "mean_of_centres",
    "mean_of_nodes",
    "nodal_mean",
    "patch_recovery",
    "project",
    "recover",
    "superconvergent_samples",
    "surface_points",
]
