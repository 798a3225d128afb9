"""Reports: pages of texts, tables, charts and views of meshes into one HTML file that needs no network."""

from gibiane_ops.kernels.report.blocks import (
    Arrows,
    Block,
    Body,
    Chart,
    Curve,
    Field,
    Page,
    Picture,
    Table,
    Text,
    View,
    pareto_front,
)
from gibiane_ops.kernels.report.environment import environment_rows
from gibiane_ops.kernels.report.words import said
from gibiane_ops.kernels.report.writing import write_report

__all__ = [
    "Arrows",
    "Block",
    "Body",
    "Chart",
    "Curve",
    "Field",
    "Page",
    "Picture",
    "Table",
    "Text",
    "View",
    "environment_rows",
    "pareto_front",
    "said",
    "write_report",
]
