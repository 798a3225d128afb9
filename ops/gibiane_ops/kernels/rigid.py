"""Rigid-body motions: the modes of a cloud of points, and those that the conditions of a problem leave free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray

# A motion counts as stopped when the conditions see at least this share of it.
SEEN = 1e-7
_AXES = "xyz"

ROUND_OFF = 1e-11
"""Work of the stiffness in a motion, over that of its diagonal alone, that is none."""


def rigid_modes(points: FloatArray, centre: FloatArray | None = None) -> FloatArray:
    """Build the rigid-body modes of a cloud of points.

    Parameters
    ----------
    points : (n, dim) float64, length
        dim 2 or 3.
    centre : (dim,) float64, optional
        Point that the rotations leave in place, the origin by default.

    Returns
    -------
    (n * dim, 3) or (n * dim, 6) float64
        Translations along x y (z), then the rotation in the plane, or the rotations about x y z; ``u = omega x p``.
    """
    x = points if centre is None else points - centre
    n, dim = x.shape
    modes = np.zeros((n, dim, 3 if dim == 2 else 6))
    modes[:, range(dim), range(dim)] = 1.0
    if dim == 2:
        modes[:, 0, 2], modes[:, 1, 2] = -x[:, 1], x[:, 0]
    else:
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            modes[:, i, 3 + k], modes[:, j, 3 + k] = -x[:, j], x[:, i]
    return modes.reshape(n * dim, -1)


def unseen(A: FloatArray, limit: float) -> FloatArray:
    """Find the combinations of a few columns that many rows do not see.

    Parameters
    ----------
    A : (n, k) float64
    limit : float
        Singular values up to this one are none.

    Returns
    -------
    (q, k) float64
        Orthonormal rows.

    Cost
    ----
    n k^2, without a matrix of n by n.
    """
    # rows of zeros, so that there are as many singular values as columns
    _, values, right = np.linalg.svd(np.pad(A, ((0, A.shape[1]), (0, 0))), full_matrices=False)
    return np.asarray(right[values <= limit], np.float64)


def dependent_motion(points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Express the displacements of a rigid body by as few of them as determine the others.

    Parameters
    ----------
    points : (n, dim) float64, length
        dim 2 or 3.

    Returns
    -------
    masters : (k,) int64
        Unknowns ``dim i + c`` that can be chosen freely: 3 in the plane and 6 in space, fewer for aligned or
        coincident points.
    followers : (n dim - k,) int64
        The others, increasing.
    coefficients : (n dim - k, k) float64
        ``u[followers] = coefficients . u[masters]`` in every rigid motion of first order.

    Notes
    -----
    The masters are the pivots of a QR factorisation with column pivoting of the rigid modes, so that they stand far
    from each other and the coefficients stay of order one.
    """
    from scipy.linalg import qr

    centre = points.mean(axis=0)
    radius = float(np.abs(points - centre).max(initial=0.0)) or 1.0
    modes = rigid_modes((points - centre) / radius)
    _, R, order = qr(modes.T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    k = int((diagonal > 1e-10 * diagonal[0]).sum())
    masters = np.sort(order[:k]).astype(np.int64)
    followers = np.setdiff1d(np.arange(modes.shape[0]), masters)
    coefficients, *_ = np.linalg.lstsq(modes[masters].T, modes[followers].T, rcond=None)
    coefficients[np.abs(coefficients) < 1e-12] = 0.0
    return masters, followers, np.asarray(coefficients.T, np.float64)


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A rigid motion that nothing stops.

    Attributes
    ----------
    solids : tuple of int
        Solids that move, counted in the order of their first node; several move together when conditions tie them.
    nodes : (k,) int64
        Nodes of the solids that move.
    translation : (dim,) float64
        Velocity of the centre of the solid that moves most; the largest of velocities and rotations is 1.
    rotation : (3,) float64
        Rotation vector, times the radius of the solid; in a plane only its last component can be non-zero.
    centre : (dim,) float64, length
        Mean of the nodes of the solid that moves most.
    axis_point : (dim,) float64, length
        A point of the axis of rotation; the centre for a translation.
    """

    solids: tuple[int, ...]
    nodes: IntArray
    translation: FloatArray
    rotation: FloatArray
    centre: FloatArray
    axis_point: FloatArray

    @property
    def kind(self) -> str:
        """Return 'translation', 'rotation', or 'screw' when both act along the same axis."""
        if not self.rotation.any():
            return "translation"
        along = np.abs(self.rotation[: len(self.translation)] @ self.translation) if len(self.translation) == 3 else 0.0
        return "screw" if along > 1e-6 * np.linalg.norm(self.rotation) else "rotation"

    @property
    def movement(self) -> str:
        """Name the motion: ``translation along x``, ``rotation about z through (0, 0, 25)``."""
        if self.kind == "translation":
            return f"translation along {_direction(self.translation)}"
        where = ", ".join(f"{x:g}" for x in self.axis_point)
        return f"{self.kind} about {_direction(self.rotation)} through ({where})"

    def __str__(self) -> str:
        who = f"solid {self.solids[0]}" if len(self.solids) == 1 else f"solids {', '.join(map(str, self.solids))}"
        return f"{who}: {self.movement}"


def _direction(vector: FloatArray) -> str:
    """Name an axis, or write the unit vector."""
    unit = vector / np.linalg.norm(vector)
    main = int(np.argmax(np.abs(unit)))
    if abs(abs(unit[main]) - 1.0) < 1e-6:
        return _AXES[main]
    return "(" + ", ".join(f"{x:.3g}" for x in unit) + ")"


def free_motions(K: sp.sparray, points: FloatArray, C: sp.sparray) -> list[FreeMotion]:
    """Find the rigid motions of solids that neither the conditions nor springs stop.

    Parameters
    ----------
    K : (n * dim, n * dim) sparse, symmetric
        Stiffness; a solid is a set of nodes that it connects, a node without stiffness belongs to none. Springs to the
        ground are in it: a motion that they resist is not free.
    points : (n, dim) float64, length
    C : (m, n * dim) sparse
        All conditions ``C u = d`` as given by the user. Rows that tie two solids, or that stand for contact pairs
        expected to stay closed (``n . (u1 - u2) = 0``), count as well as supports.

    Returns
    -------
    list of FreeMotion
        Empty when every solid is held. Independent of each other, pure translations and rotations where possible;
        by solid, translations first.

    Notes
    -----
    The conditions are applied to the rigid modes of all the solids together; each motion in the null space is free.
    Mechanisms inside a solid (two blocks that share one edge) are not rigid motions of it and are not found.

    Cost
    ----
    One pass over the entries of K, and one small factorisation per group of tied solids.
    """
    from scipy.sparse.csgraph import connected_components

    n, dim = points.shape
    solid = solids(sp.csr_array(K), n, dim)
    n_solids = int(solid.max(initial=-1)) + 1
    n_modes = 3 if dim == 2 else 6
    centres, radii, modes = _solid_modes(points, solid, n_solids)
    seen = sp.csr_array(C) @ modes
    seen.eliminate_zeros()
    gram = sp.csr_array(modes.T @ modes)
    rows, columns = seen.nonzero()
    links = sp.csr_array(
        (np.ones(len(rows)), (columns // n_modes, rows + n_solids)), shape=(n_solids + seen.shape[0],) * 2
    )
    _, label = connected_components(links, directed=False)
    found = []
    for name in dict.fromkeys(label[:n_solids].tolist()):
        members = np.flatnonzero(label[:n_solids] == name)
        unknowns = (members[:, None] * n_modes + np.arange(n_modes)).ravel()
        conditions = np.flatnonzero(label[n_solids:] == name)
        stopped = [seen[conditions][:, unknowns].toarray(), _still(gram[unknowns][:, unknowns].toarray())]
        free = _effortless(K, modes[:, unknowns], _null_space(np.concatenate(stopped)))
        basis = _readable(free, dim, n_modes)
        for motion in basis.T.reshape(-1, len(members), n_modes):
            found.append(_describe(motion, members, solid, centres, radii))
    return sorted(found, key=lambda motion: (motion.solids, bool(motion.rotation.any())))


def solids(K: sp.csr_array, n: int, dim: int) -> IntArray:
    """Find the solids that a stiffness connects.

    Parameters
    ----------
    K : (n * dim, n * dim) csr_array, symmetric
    n, dim : int
        Nodes, and unknowns of each.

    Returns
    -------
    (n,) int64
        Solid of each node, in the order of their first nodes; -1 where there is no stiffness.
    """
    from scipy.sparse.csgraph import connected_components

    # The graph of the nodes: the components of one node belong together even where the matrix does not couple them.
    blocks = K.tobsr(blocksize=(dim, dim))
    graph = sp.csr_array((np.ones(len(blocks.indices)), blocks.indices, blocks.indptr), shape=(n, n))
    # In a symmetric graph strong components are the components, found without its transpose.
    _, of_node = connected_components(graph, directed=True, connection="strong")
    stiff = (K.diagonal().reshape(n, dim) != 0).any(axis=1)
    solid = np.full(n, -1, np.int64)
    names, first_node, number = np.unique(of_node[stiff], return_index=True, return_inverse=True)
    rank = np.empty(len(names), np.int64)
    rank[np.argsort(first_node)] = np.arange(len(names))
    solid[stiff] = rank[number]
    return solid


def _solid_modes(points: FloatArray, solid: IntArray, n_solids: int) -> tuple[FloatArray, FloatArray, sp.csr_array]:
    """Return centres, radii, and the rigid modes of every solid about its centre, rotations divided by its radius."""
    n, dim = points.shape
    used = solid >= 0
    count = np.bincount(solid[used], minlength=n_solids)
    sums = [np.bincount(solid[used], points[used, i], n_solids) for i in range(dim)]
    centres: FloatArray = np.stack(sums, axis=1) / count[:, None]
    arm = np.zeros((n, dim))
    arm[used] = points[used] - centres[solid[used]]
    radii = np.zeros(n_solids)
    np.maximum.at(radii, solid[used], np.linalg.norm(arm[used], axis=1))
    # A solid of one node has no rotation; any length serves.
    radii[radii == 0] = 1.0
    arm[used] /= radii[solid[used], None]
    modes = rigid_modes(arm)
    n_modes = modes.shape[1]
    rows = np.flatnonzero(np.repeat(used, dim))
    columns = solid[rows // dim, None] * n_modes + np.arange(n_modes)
    place = (np.repeat(rows, n_modes), columns.ravel())
    return centres, radii, sp.csr_array((modes[rows].ravel(), place), shape=(n * dim, n_solids * n_modes))


def _still(gram: FloatArray) -> FloatArray:
    """Return the combinations of modes that move no node, by rows: rotations of a bar about itself, of a point."""
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(vectors[:, values <= SEEN**2 * values[-1]].T, np.float64)


def _effortless(K: sp.sparray, modes: sp.csr_array, basis: FloatArray) -> FloatArray:
    """Keep the combinations, (n_modes, k), of motions that the stiffness does not resist."""
    if basis.shape[1] == 0:
        return basis
    motions = modes @ basis
    work = motions.T @ (K @ motions)
    # no motion of solids works: what is left of large terms that cancel
    scale = np.sqrt((K.diagonal()[:, None] * motions**2).sum(axis=0))
    values, vectors = np.linalg.eigh(work / np.outer(scale, scale))
    kept = vectors[:, values <= ROUND_OFF] / scale[:, None]
    return np.asarray(np.linalg.qr(basis @ kept)[0], np.float64) if kept.shape[1] else basis[:, :0]


def _null_space(A: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the null space of the rows, each taken at the same scale."""
    size = np.linalg.norm(A, axis=1)
    A = A[size > 0] / size[size > 0, None]
    if len(A) == 0:
        return np.eye(A.shape[1])
    if len(A) > A.shape[1]:
        A = np.asarray(np.linalg.qr(A, mode="r"))
    _, singular, V = np.linalg.svd(A)
    rank = int((singular > SEEN * singular[0]).sum())
    return np.asarray(V[rank:].T, np.float64)


def _readable(basis: FloatArray, dim: int, n_modes: int) -> FloatArray:
    """Change the basis so that each vector holds as few modes as possible (reduced echelon form).

    Rotations are taken first: a solid held at one point then gets rotations about axes through this point, and what
    remains is pure translation.
    """
    basis = basis.copy()
    is_rotation = np.arange(len(basis)) % n_modes >= dim
    done = 0
    for row in np.r_[np.flatnonzero(is_rotation), np.flatnonzero(~is_rotation)]:
        if done == basis.shape[1]:
            break
        pivot = done + int(np.argmax(np.abs(basis[row, done:])))
        if abs(basis[row, pivot]) < 1e-6:
            continue
        basis[:, [done, pivot]] = basis[:, [pivot, done]]
        basis[:, done] /= basis[row, done]
        others = np.arange(basis.shape[1]) != done
        basis[:, others] -= np.outer(basis[:, done], basis[row, others])
        done += 1
    basis /= np.abs(basis).max(axis=0, initial=0.0)
    basis[np.abs(basis) < 1e-9] = 0.0
    return basis


def _describe(
    motion: FloatArray, members: IntArray, solid: IntArray, centres: FloatArray, radii: FloatArray
) -> FreeMotion:
    """Turn amplitudes, (n_members, n_modes), into a record."""
    dim = centres.shape[1]
    moving = np.abs(motion).max(axis=1) > 1e-6
    most = int(np.argmax(np.abs(motion).max(axis=1)))
    translation = motion[most, :dim]
    rotation = np.r_[np.zeros(2 if dim == 2 else 0), motion[most, dim:]]
    centre, radius = centres[members[most]], radii[members[most]]
    square = rotation @ rotation
    # The point where omega x (p - c) cancels the part of the translation across the axis.
    shift = np.cross(rotation, np.r_[translation, np.zeros(3 - dim)]) / square * radius if square > 0 else np.zeros(3)
    return FreeMotion(
        solids=tuple(members[moving].tolist()),
        nodes=np.flatnonzero(np.isin(solid, members[moving])),
        translation=translation,
        rotation=rotation,
        centre=centre,
        axis_point=centre + shift[:dim],
    )
