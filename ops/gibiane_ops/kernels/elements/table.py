"""The list of known shapes; a new one is its own file and one entry here."""

from __future__ import annotations

from gibiane_ops.kernels.elements.hexahedron import CU20, CUB8
from gibiane_ops.kernels.elements.point import POI1
from gibiane_ops.kernels.elements.prism import PR15, PRI6
from gibiane_ops.kernels.elements.pyramid import PY13, PYR5
from gibiane_ops.kernels.elements.quadrangle import QUA4, QUA8
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.segment import SEG2, SEG3
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.tetrahedron import TE10, TET4
from gibiane_ops.kernels.elements.triangle import TRI3, TRI6
from gibiane_ops.kernels.errors import BadValue

SHAPES: dict[str, Shape] = {
    each.name: each
    for each in (POI1, SEG2, TRI3, QUA4, TET4, PYR5, PRI6, CUB8, SEG3, TRI6, QUA8, TE10, PY13, PR15, CU20)
}
BY_MESHIO: dict[str, Shape] = {each.meshio_name: each for each in SHAPES.values()}


def quadratic(name: str) -> Shape:
    """Find the shape of second degree that has the corners of a linear one.

    Parameters
    ----------
    name : str
        E.g. ``CUB8``.

    Returns
    -------
    Shape
        E.g. ``CU20``.

    Raises
    ------
    BadValue
        When there is none.
    """
    if name not in QUADRATIC:
        raise BadValue("linear shape", name, f"one of {' '.join(QUADRATIC)}")
    return SHAPES[QUADRATIC[name]]


def shape(name: str) -> Shape:
    """Find a shape by its name.

    Parameters
    ----------
    name : str
        E.g. ``CUB8``.

    Returns
    -------
    Shape

    Raises
    ------
    BadValue
        When no shape has this name.
    """
    found = SHAPES.get(name)
    if found is None:
        raise BadValue("shape", name, f"one of {' '.join(SHAPES)}")
    return found
