"""Pictures: meshes, fields and curves into PNG, SVG or PDF files. Matplotlib is imported when a picture is drawn."""

from gibiane_ops.kernels.plot.curves import Curve, draw_curves
from gibiane_ops.kernels.plot.layers import (
    BODY_COLORS,
    Arrows,
    Dots,
    Labels,
    Layer,
    Lines,
    Surface,
    amplification,
    beyond,
    lifts,
    outline,
)
from gibiane_ops.kernels.plot.scales import Scale
from gibiane_ops.kernels.plot.scene import draw_scene

__all__ = [
    "BODY_COLORS",
    "Arrows",
    "Curve",
    "Dots",
    "Labels",
    "Layer",
    "Lines",
    "Scale",
    "Surface",
    "amplification",
    "beyond",
    "draw_curves",
    "draw_scene",
    "lifts",
    "outline",
]
