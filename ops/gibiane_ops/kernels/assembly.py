"""Element matrices and vectors in batches, and their assembly into sparse matrices.

Unknowns are numbered by node, ``d * node + component``. Blocks of cells come as ``(cells, element arrays)`` so that
meshes of several shapes assemble in one call.

Axisymmetric cells lie in a meridian plane (radius, height): the zz component is the hoop one, and integrals go once
round the axis, with the factor 2 pi r. Forces, masses and energies are those of the whole body of revolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import N_COMPONENTS, FloatArray, IntArray, component_of, stress_tensor
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.errors import InvertedElement

# Elements treated together: large enough to hide the interpreter, small enough to stay in the caches.
CHUNK = 1024


def strain_operator(shape: Shape, X: FloatArray, xi: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
    """Build B, which gives the strains from the nodal displacements.

    Parameters
    ----------
    shape : Shape
        ``dim`` 2 (plane) or 3.
    X : (m, n_nodes, dim) float64, length
    xi : (q, dim) float64
        Off the axis, where the hoop strain divides by the radius.
    axisymmetric : bool

    Returns
    -------
    (m, q, n_strains, n_nodes * dim) float64, 1 / length
        6 strains in 3D, 4 in a plane (the zz row is zero: eps_zz of plane stress follows from the material), or of a
        body of revolution (zz is the hoop strain ``u_r / r``).
    """
    gradient, _ = geometry.gradients(shape, X, xi)
    m, q, n, dim = gradient.shape
    B = np.zeros((m, q, N_COMPONENTS[dim], n, dim))
    for i in range(dim):
        for j in range(dim):
            B[:, :, component_of(i, j), :, i] = gradient[..., j]
    if axisymmetric:
        N = shape.N(xi)
        B[:, :, component_of(2, 2), :, 0] = N / np.matmul(N, X[:, :, 0, None])
    return B.reshape(m, q, N_COMPONENTS[dim], n * dim)


def element_stiffness(shape: Shape, X: FloatArray, D: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the stiffness matrices of cells.

    Parameters
    ----------
    shape : Shape
        ``dim`` 2 (plane, unit thickness, or meridian plane) or 3.
    X : (m, n_nodes, dim) float64, length
    D : (n_strains, n_strains) or (m, n_strains, n_strains) float64, force / length^2, symmetric
        Hooke law, the same everywhere or one per cell; see `materials.isotropic`.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes * dim, n_nodes * dim) float64, symmetric
        Unknowns ordered by node.

    Raises
    ------
    InvertedElement
        When a jacobian is not positive at an integration point.

    Notes
    -----
    ``K[ai, bk] = sum_jl C[ijkl] Z[aj, bl]`` with ``Z = int grad N (x) grad N``: one batched product for Z, then the
    material acts on the 3x3 blocks of the node pairs. No use is made of cells being equal.

    Cost
    ----
    About 0.5 s and 155 Mbyte (the result) for 33 000 CUB8.
    """
    points, weights = shape.gauss
    geometry.check_cells(shape, X, points)
    if axisymmetric:
        return _ring_stiffness(shape, X, D)
    m, n, dim = X.shape
    law = _block_law(D, dim)
    K = np.empty((m, n, dim, n, dim))
    for start in range(0, m, CHUNK):
        part = slice(start, start + CHUNK)
        gradient, det = geometry.gradients(shape, X[part], points)
        gradient *= np.sqrt(weights * det)[..., None, None]
        G = gradient.reshape(*gradient.shape[:2], n * dim)
        Z = np.matmul(G.transpose(0, 2, 1), G).reshape(-1, n, dim, n, dim).transpose(0, 1, 3, 2, 4)
        pairs = Z.reshape(len(Z), n * n, dim * dim)
        # Batched even for one law: as a single tall product, BLAS threads cost more than they bring.
        blocks = np.matmul(pairs, law[part] if law.ndim == 3 else law)
        K[part] = blocks.reshape(-1, n, n, dim, dim).transpose(0, 1, 3, 2, 4)
    return K.reshape(m, n * dim, n * dim)


def _ring_stiffness(shape: Shape, X: FloatArray, D: FloatArray) -> FloatArray:
    """Return the stiffness of axisymmetric cells: the hoop strain couples values with gradients, so B is formed."""
    points = shape.gauss[0]
    factor = geometry.point_measures(shape, X, shape.gauss, axisymmetric=True)
    K = np.empty((len(X), 2 * shape.n_nodes, 2 * shape.n_nodes))
    for start in range(0, len(X), CHUNK):
        part = slice(start, start + CHUNK)
        B = strain_operator(shape, X[part], points, axisymmetric=True)
        stress = np.matmul(D[part, None] if D.ndim == 3 else D, B) * factor[part, :, None, None]
        size = (len(B), -1, B.shape[-1])
        product = np.matmul(B.reshape(size).transpose(0, 2, 1), stress.reshape(size))
        K[part] = (product + product.transpose(0, 2, 1)) / 2
    return K


def _block_law(D: FloatArray, dim: int) -> FloatArray:
    """Return the matrix that turns the (j, l) block of Z into the (i, k) block of K: ``law[.., jl, ik] = C[ijkl]``."""
    place = np.array([[component_of(i, j) for j in range(dim)] for i in range(dim)])
    C = D[..., place[:, :, None, None], place[None, None, :, :]]
    return np.moveaxis(C, (-3, -1), (-4, -3)).reshape(*D.shape[:-2], dim * dim, dim * dim)


@dataclass(frozen=True, eq=False)
class NodePattern:
    """Where each node pair of each cell goes in the assembled matrix; reusable while the mesh stays.

    Attributes
    ----------
    indptr, indices : int32
        Rows and columns of the node graph, CSR, columns sorted.
    gather : (n_node_pairs, n_cell_pairs) CSR of ones
        Sums the blocks of the cells into those of the graph.
    n_nodes : int
    """

    indptr: IntArray
    indices: IntArray
    gather: sp.csr_array
    n_nodes: int


def node_pattern(n_nodes: int, cells: Sequence[IntArray]) -> NodePattern:
    """Find the graph of the node pairs that share a cell.

    Parameters
    ----------
    n_nodes : int
    cells : sequence of (m, n) int64
        One array per block.

    Returns
    -------
    NodePattern

    Cost
    ----
    One sort of ``sum m n^2`` integers.
    """
    keys = np.concatenate([(c[:, :, None] * np.int64(n_nodes) + c[:, None, :]).ravel() for c in cells])
    order = np.argsort(keys)
    keys = keys[order]
    first = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]]) if len(keys) else np.zeros(0, np.int64)
    rows, columns = np.divmod(keys[first], n_nodes)
    indptr = np.r_[0, np.cumsum(np.bincount(rows, minlength=n_nodes))].astype(np.int32)
    starts = np.r_[first, len(keys)].astype(np.int32)
    gather = sp.csr_array((np.ones(len(keys)), order.astype(np.int32), starts), shape=(len(first), len(keys)))
    return NodePattern(indptr, columns.astype(np.int32), gather, n_nodes)


def assemble(
    n_nodes: int, d: int, blocks: Sequence[tuple[IntArray, FloatArray]], pattern: NodePattern | None = None
) -> sp.csr_array:
    """Assemble element matrices.

    Parameters
    ----------
    n_nodes : int
    d : int
        Unknowns per node; 1 for a scalar mass matrix.
    blocks : sequence of (cells, Ke)
        cells : (m, n) int64 and Ke : (m, n * d, n * d) float64.
    pattern : NodePattern, optional
        Of the same cells, when already known.

    Returns
    -------
    (n_nodes * d, n_nodes * d) csr_array, sorted indices
        Explicit zeros are kept, so that every d x d block is whole.

    Cost
    ----
    About 0.5 s and 350 Mbyte at the peak for 33 000 CUB8.
    """
    graph = node_pattern(n_nodes, [cells for cells, _ in blocks]) if pattern is None else pattern
    pairs = [
        Ke.reshape(len(c), c.shape[1], d, c.shape[1], d).transpose(0, 1, 3, 2, 4).reshape(-1, d * d) for c, Ke in blocks
    ]
    data = (graph.gather @ (pairs[0] if len(pairs) == 1 else np.concatenate(pairs))).reshape(-1, d, d)
    size = n_nodes * d
    return sp.csr_array(sp.bsr_array((data, graph.indices, graph.indptr), shape=(size, size)).tocsr())


def assemble_vector(n_nodes: int, d: int, blocks: Sequence[tuple[IntArray, FloatArray]]) -> FloatArray:
    """Assemble element vectors.

    Parameters
    ----------
    n_nodes : int
    d : int
    blocks : sequence of (cells, Fe)
        cells : (m, n) int64 and Fe : (m, n, d) float64.

    Returns
    -------
    (n_nodes * d,) float64
    """
    total = np.zeros((n_nodes, d))
    for cells, Fe in blocks:
        nodes = cells.ravel()
        for i in range(d):
            total[:, i] += np.bincount(nodes, Fe[..., i].ravel(), minlength=n_nodes)
    return total.ravel()


def strains(
    shape: Shape,
    X: FloatArray,
    U: FloatArray,
    xi: FloatArray,
    *,
    axisymmetric: bool = False,
    checked: bool = False,
    quadratic: bool = False,
) -> FloatArray:
    """Compute the strains of a displacement field.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, dim) float64, length
    U : (m, n_nodes, dim) float64, length
        Nodal displacements of the cells.
    xi : (q, dim) float64
        Off the axis, where the hoop strain divides by the radius.
    axisymmetric : bool
    checked : bool
        Refuse cells whose jacobian is not positive there.
    quadratic : bool
        Add the terms of second order: Green and Lagrange's strain ``(H + H^T + H^T H) / 2``, H the gradient of the
        displacement in the undeformed state, which no rotation changes.

    Returns
    -------
    (m, q, n_strains) float64
        Engineering shears. In a plane eps_zz is 0; for plane stress take it from `materials.compliance`. In a body of
        revolution it is the hoop strain ``u_r / r``.
    """
    dim = X.shape[2]
    found = np.empty((len(X), len(xi), N_COMPONENTS[dim]))
    for start in range(0, len(X), CHUNK):
        part = slice(start, start + CHUNK)
        try:
            H = geometry.vector_gradients(shape, X[part], U[part], xi, checked=checked)
        except InvertedElement:
            geometry.check_cells(shape, X, xi)  # the same failure, with the numbers of all cells
            raise
        if dim == 2:
            found[part, :, component_of(2, 2)] = 0.0
        for i in range(dim):
            found[part, :, component_of(i, i)] = H[..., i, i]
            for j in range(i + 1, dim):
                found[part, :, component_of(i, j)] = H[..., i, j] + H[..., j, i]
        if quadratic:
            for i in range(dim):
                for j in range(i, dim):
                    product = (H[..., i] * H[..., j]).sum(axis=-1)
                    found[part, :, component_of(i, j)] += 0.5 * product if i == j else product
    if axisymmetric:
        N = shape.N(xi)
        hoop = (U[:, :, 0] @ N.T) / (X[:, :, 0] @ N.T)
        found[:, :, component_of(2, 2)] = hoop + 0.5 * hoop**2 if quadratic else hoop
    return found


def stresses(strain: FloatArray, D: FloatArray) -> FloatArray:
    """Apply Hooke's law.

    Parameters
    ----------
    strain : (m, q, n_strains) float64
    D : (n_strains, n_strains) or (m, n_strains, n_strains) float64

    Returns
    -------
    (m, q, n_strains) float64, force / length^2
    """
    return np.asarray(strain @ D.swapaxes(-1, -2), np.float64)


def internal_forces(shape: Shape, X: FloatArray, stress: FloatArray, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the nodal forces that balance stresses given at the integration points.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, dim) float64, length
    stress : (m, q, n_strains) float64
        At the points of ``shape.gauss``.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, dim) float64, force
        ``int B^T sigma``; equal to ``Ke u`` when the stress comes from u.

    Raises
    ------
    InvertedElement
        When a jacobian is not positive at an integration point.
    """
    points, weights = shape.gauss
    geometry.check_cells(shape, X, points)
    gradient, det = geometry.gradients(shape, X, points)
    dim = X.shape[2]
    factor = det * weights
    if axisymmetric:
        factor = factor * geometry.circumferences(shape, X, points)
    tensor = stress_tensor(stress)
    forces = np.matmul(gradient, tensor[..., :dim, :dim] * factor[..., None, None]).sum(axis=1)
    if axisymmetric:
        N = shape.N(points)
        forces[..., 0] += (tensor[..., 2, 2] * factor / (X[:, :, 0] @ N.T)) @ N
    return np.asarray(forces, np.float64)


def pressure_load(face_shape: Shape, X: FloatArray, p: ArrayLike, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent nodal forces of a pressure.

    Parameters
    ----------
    face_shape : Shape
        A facet: ``dim == space_dim - 1``, nodes turning so that the normal leaves the solid.
    X : (m, n_nodes, space_dim) float64, length
    p : scalar, (m,) or (m, n_nodes) float64, force / length^2
        Positive when it pushes on the solid; one value per facet, or nodal values that are interpolated.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, space_dim) float64, force
        ``F_a = - int N_a p n dS``.
    """
    points, weights = face_shape.mass_gauss
    N = face_shape.N(points)
    value = np.asarray(p, np.float64)
    forces = np.empty(X.shape)
    for start in range(0, len(X), 16 * geometry.PIECE):
        part = slice(start, start + 16 * geometry.PIECE)
        at_points = value if value.ndim == 0 else value[part] if value.ndim == 1 else (value[part] @ N.T).T
        if axisymmetric:
            at_points = at_points * geometry.circumferences(face_shape, X[part], points).T
        flux = geometry.normal_densities(face_shape, X[part], points).T * (-weights[:, None] * at_points)
        forces[part] = np.matmul(N.T, flux).T
    return forces


def distributed_load(shape: Shape, X: FloatArray, density: ArrayLike, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent nodal forces of a force per unit of length, area or volume.

    Parameters
    ----------
    shape : Shape
        Any shape: a line, a facet, or the solid itself for a body force.
    X : (m, n_nodes, space_dim) float64, length
    density : (d,), (m, d) or (m, n_nodes, d) float64
        Uniform, per cell, or nodal values that are interpolated.
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, d) float64, force
        ``F_a = int N_a t``.
    """
    points = shape.mass_gauss[0]
    N = shape.N(points)
    value = np.asarray(density, np.float64)
    at_points = np.matmul(N, value) if value.ndim == 3 else np.atleast_2d(value)[:, None, :]
    factor = geometry.point_measures(shape, X, shape.mass_gauss, axisymmetric=axisymmetric)
    return np.asarray(np.matmul(N.T, at_points * factor[..., None]), np.float64)


def element_mass(shape: Shape, X: FloatArray, density: ArrayLike = 1.0, *, axisymmetric: bool = False) -> FloatArray:
    """Compute the consistent mass matrices of one scalar component.

    Parameters
    ----------
    shape : Shape
        Any shape.
    X : (m, n_nodes, space_dim) float64, length
    density : scalar or (m,) float64
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes, n_nodes) float64, symmetric
        ``M_ab = int density N_a N_b``; every displacement component has the same.
    """
    N = shape.N(shape.mass_gauss[0])
    factor = (
        geometry.point_measures(shape, X, shape.mass_gauss, axisymmetric=axisymmetric)
        * np.asarray(density, np.float64)[..., None]
    )
    products = (N[:, :, None] * N[:, None, :]).reshape(len(N), -1)
    return (factor @ products).reshape(len(X), shape.n_nodes, shape.n_nodes)


def lumped_mass(shape: Shape, X: FloatArray, density: ArrayLike = 1.0, *, axisymmetric: bool = False) -> FloatArray:
    """Compute diagonal mass matrices of one scalar component.

    Parameters
    ----------
    shape : Shape
    X : (m, n_nodes, space_dim) float64, length
    density : scalar or (m,) float64
    axisymmetric : bool

    Returns
    -------
    (m, n_nodes) float64, positive
        Their sum is the mass of the cell.

    Notes
    -----
    Sums of the rows of the consistent matrix for linear shapes. In those of second degree such sums are zero or
    negative at corners: there the diagonal of the consistent matrix is scaled to the mass of the cell.

    Source
    ------
    Hinton, Rock, Zienkiewicz 1976.
    """
    M = element_mass(shape, X, density, axisymmetric=axisymmetric)
    if shape.degree < 2:
        return np.asarray(M.sum(axis=2), np.float64)
    diagonal = np.diagonal(M, axis1=1, axis2=2)
    total: FloatArray = diagonal * (M.sum(axis=(1, 2)) / diagonal.sum(axis=1))[:, None]
    return total


def face_mass(face_shape: Shape, X: FloatArray) -> FloatArray:
    """Compute the mass matrices of facets, which relate nodal forces F and densities R by ``M R = F``.

    Parameters
    ----------
    face_shape : Shape
    X : (m, n_nodes, space_dim) float64, length

    Returns
    -------
    (m, n_nodes, n_nodes) float64, symmetric
        Area / 36 [4 2 1 2; ...] for a parallelogram, area / 12 (1 + delta_ab) for a triangle.

    Raises
    ------
    InvertedElement
        When a facet has no area.
    """
    geometry.check_cells(face_shape, X, face_shape.mass_gauss[0])
    return element_mass(face_shape, X)
