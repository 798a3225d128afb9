"""Stiffness, strains, stresses and nodal forces of elastic cells, in batches.

Axisymmetric cells lie in a meridian plane (radius, height): the zz component is the hoop one, and integrals go once
round the axis, with the factor 2 pi r. Forces and energies are those of the whole body of revolution.
"""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels import geometry
from gibiane_ops.kernels.arrays import N_COMPONENTS, FloatArray, component_of, stress_tensor
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
