"""The record that describes a reference shape; everything else in the kernels reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.quadrature import Rule

Basis = Callable[[FloatArray], FloatArray]
Face = tuple[str, tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class Shape:
    """A reference shape and its Lagrange interpolation.

    Attributes
    ----------
    name : str
        Name in the language, e.g. ``CUB8``.
    dim : int
        Dimension of the reference space.
    degree : int
        Degree of the polynomials that the interpolation holds completely.
    ref_nodes : (n_nodes, dim) float64
        Reference coordinates of the nodes, in the numbering of VTK: corners, then the mid-nodes of the edges in the
        order of `edges`. (Cast3M numbers its quadratic elements otherwise, corners and mid-nodes in turn.)
    N : callable
        ``N(xi)`` with xi : (q, dim) gives the shape functions, (q, n_nodes).
    dN : callable
        ``dN(xi)`` gives their derivatives, (q, n_nodes, dim).
    faces : tuple of (str, tuple of int)
        Shape name and local nodes of each facet (dimension dim - 1). In 3D the nodes turn counterclockwise seen from
        outside; in 2D an edge has the element on its left.
    edges : tuple of tuple of int
        Local nodes of the edges, ends first.
    stiffness_rule : Rule
        Rule for the products of gradients.
    mass_rule : Rule
        Rule for the products of shape functions.
    gmsh_type : int
        Element code of gmsh.
    meshio_name : str
        Cell name of meshio.
    n_corners : int
        The first n_corners nodes are the corners; a facet is identified by its corners.
    """

    name: str
    dim: int
    degree: int
    ref_nodes: FloatArray
    N: Basis
    dN: Basis
    faces: tuple[Face, ...]
    edges: tuple[tuple[int, ...], ...]
    stiffness_rule: Rule
    mass_rule: Rule
    gmsh_type: int
    meshio_name: str
    n_corners: int

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.ref_nodes)

    @property
    def gauss(self) -> tuple[FloatArray, FloatArray]:
        """Points (q, dim) and weights (q,) of the stiffness rule."""
        return self.stiffness_rule.points, self.stiffness_rule.weights

    @property
    def mass_gauss(self) -> tuple[FloatArray, FloatArray]:
        """Points (q, dim) and weights (q,) of the mass rule."""
        return self.mass_rule.points, self.mass_rule.weights
