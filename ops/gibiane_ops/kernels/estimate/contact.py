"""Contact part of the error: how far the tractions and the relative displacements are from Coulomb's law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels import assembly, geometry, integrals, topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.contact.cone import norms, radial_projection
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.solve import factorize
from gibiane_ops.kernels.topology import Block

VARIANTS = ("DENS", "NODE", "DLUM")


@dataclass(frozen=True, eq=False)
class ContactError:
    """Squared contact error of each facet.

    Attributes
    ----------
    facet : list of (m,) float64, energy
        One array for each block of facets, never negative.
    density : (k, d) float64, force / length^(d - 1)
        Contact traction at the nodes, normal component first, after the cut into the cone; nodal forces for NODE.
    corrected : int
        Nodes whose traction lay outside the cone (or in tension) and was cut.
    """

    facet: list[FloatArray]
    density: FloatArray
    corrected: int

    @property
    def total(self) -> float:
        """Sum over the facets."""
        return float(sum(each.sum() for each in self.facet))


def densities(
    points: FloatArray,
    facets: Sequence[Block],
    nodes: IntArray,
    force: FloatArray,
    *,
    lumped: bool = False,
    axisymmetric: bool = False,
) -> FloatArray:
    """Turn nodal contact forces into tractions.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    facets : list of (str, (m, n) int64)
        Facets of the contact surface of body 1.
    nodes : (k,) int64
        Nodes of these facets that carry contact. Middles on the side of a linear facet follow its corners.
    force : (k, d) float64, force
        Global components.
    lumped : bool
        Divide by the row sums of M instead of solving.
    axisymmetric : bool
        Forces are those once round the axis; the first coordinate is the radius.

    Returns
    -------
    (k, d) float64, force / length^(d - 1)
        ``M R = F``, M the mass matrix of the facets (of the surface, not of the solid).

    Cost
    ----
    One factorisation of size k.
    """
    every, follow = with_following(facets, nodes)
    masses = [
        (_local(every, cells), integrals.element_mass(shape(name), points[cells], axisymmetric=axisymmetric))
        for name, cells in facets
    ]
    if lumped:
        ones = [(cells, mass.sum(axis=2)[:, :, None]) for cells, mass in masses]
        row_sums = follow.T @ assembly.assemble_vector(len(every) + 1, 1, ones)[:-1]
        return np.asarray(force / row_sums[:, None], np.float64)
    # A node without contact keeps a zero density: its row and column drop out.
    M = assembly.assemble(len(every) + 1, 1, masses)[: len(every), : len(every)]
    return factorize(sp.csr_array(follow.T @ M @ follow)).solve(force)


def with_following(facets: Sequence[Block], nodes: IntArray) -> tuple[IntArray, sp.csr_array]:
    """Add the middles that make no contact pair between corners that do: they follow these, beside linear elements.

    Parameters
    ----------
    facets : list of (str, (m, n) int64)
    nodes : (k,) int64
        Nodes of these facets that carry contact.

    Returns
    -------
    every : (k + h,) int64
        These nodes, then the middles.
    follow : (k + h, k) csr_array
        Values at all of them from those at the nodes.
    """
    held = topology.middles(facets)
    held = held[np.isin(held[:, :2], nodes).all(axis=1) & ~np.isin(held[:, 2], nodes)]
    k, h = len(nodes), len(held)
    order = np.argsort(nodes)
    ends = order[np.searchsorted(nodes[order], held[:, :2])] if h else np.zeros((0, 2), np.int64)
    row = np.concatenate([np.arange(k), np.repeat(k + np.arange(h), 2)])
    column = np.concatenate([np.arange(k), ends.ravel()])
    share = np.concatenate([np.ones(k), np.full(2 * h, 0.5)])
    return np.concatenate([nodes, held[:, 2]]), sp.csr_array((share, (row, column)), shape=(k + h, k))


def _local(nodes: IntArray, cells: IntArray) -> IntArray:
    """Renumber the nodes of facets by their place in a list; len(nodes) stands for those that are not in it."""
    position = np.full(max(int(cells.max()), int(nodes.max())) + 1, len(nodes), np.int64)
    position[nodes] = np.arange(len(nodes))
    return position[cells]


def contact_error(
    points: FloatArray,
    facets: Sequence[Block],
    nodes: IntArray,
    frames: FloatArray,
    force: FloatArray,
    relative: FloatArray,
    gap: FloatArray,
    mu: float | FloatArray,
    variant: str = "DENS",
    *,
    axisymmetric: bool = False,
) -> ContactError:
    """Measure the violation of the contact and friction laws, facet by facet.

    Parameters
    ----------
    points : (n_points, dim) float64, length
    facets : list of (str, (m, n) int64)
        Facets of the contact surface of body 1.
    nodes : (k,) int64
        Node of body 1 of each contact pair.
    frames : (k, d, d) float64
        Rows: outward normal of body 1, then the tangents, in global axes.
    force : (k, d) float64, force
        Nodal force on body 1 in these axes, normal first, negative in compression.
    relative : (k, d) float64, length
        Relative displacement u1 - u2 in these axes.
    gap : (k,) float64, length
        Initial gap, not negative.
    mu : float or (k,) float64
        Friction coefficient; infinity for tied tangential motion.
    variant : {'DENS', 'NODE', 'DLUM'}
        Tractions from the consistent mass, no tractions at all (sum over nodes), tractions from the lumped mass.
    axisymmetric : bool
        Forces and errors are those once round the axis.

    Returns
    -------
    ContactError

    Raises
    ------
    BadValue
        Unknown variant.

    Notes
    -----
    ``e_c^2 = int mu |R_n| |W_t| + R_t . W_t + R_n (W_n - G)`` with R cut radially into the cone and W_n - G cut at zero
    at the nodes, both interpolated: never negative where mu is uniform (inequality of the bipotential). NODE replaces
    the integral by the sum over nodes with forces in place of tractions; it vanishes for an exact nodal solution and
    so measures the solver. It is shared between the facets of a node by their share of its area.

    Source
    ------
    De Saxce and Feng 1998 (bipotential); Becheur, Tahakourt and Coorevits 2008.
    """
    if variant not in VARIANTS:
        raise BadValue("variant", variant, f"one of {' '.join(VARIANTS)}")
    coefficient = np.broadcast_to(np.asarray(mu, np.float64), len(nodes))
    raw = force
    if variant != "NODE":
        in_space = np.einsum("nij,ni->nj", frames, force)
        R = densities(points, facets, nodes, in_space, lumped=variant == "DLUM", axisymmetric=axisymmetric)
        raw = np.einsum("nij,nj->ni", frames, R)
    R = radial_projection(raw, coefficient)
    corrected = int((norms(R - raw) > 1e-9 * norms(raw).max(initial=0.0)).sum())
    normal_motion = np.minimum(relative[:, 0] - gap, 0.0)
    R_t = np.einsum("nij,ni->nj", frames[:, 1:], R[:, 1:])
    W_t = np.einsum("nij,ni->nj", frames[:, 1:], relative[:, 1:])
    # One extra row of zeros serves the nodes that carry no contact.
    fields = np.hstack([R[:, :1], R_t, normal_motion[:, None], W_t, coefficient[:, None]])
    fields = np.vstack([fields, np.zeros((1, fields.shape[1]))])
    if variant == "NODE":
        parts = _shares(points, facets, nodes, _work(fields, frames.shape[1]))
    else:
        parts = []
        every, follow = with_following(facets, nodes)
        stuck = follow @ np.isinf(fields[:-1, -1]).astype(np.float64) > 0
        fields = np.vstack([follow @ np.where(np.isinf(fields), 0.0, fields)[:-1], fields[-1:]])
        fields[:-1][stuck, -1] = np.inf
        for name, cells in facets:
            face = shape(name)
            xi, weights = face.mass_gauss
            measure = geometry.measure_densities(face, points[cells], xi) * weights
            if axisymmetric:
                measure = measure * geometry.circumferences(face, points[cells], xi)
            at = _interpolate(face.N(xi), fields[_local(every, cells)])
            parts.append(np.asarray((measure * _work(at, frames.shape[1])).sum(axis=1), np.float64))
    return ContactError(parts, R, corrected)


def _interpolate(N: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate (m, n, c) to (m, q, c); an infinite friction coefficient stays infinite, without 0 x inf."""
    infinite = np.isinf(values[..., -1]).any(axis=1)
    at = np.asarray(np.matmul(N, np.where(np.isinf(values), 0.0, values)), np.float64)
    at[infinite, :, -1] = np.inf
    return at


def _work(fields: FloatArray, d: int) -> FloatArray:
    """Compute ``mu |R_n| |W_t| + R_t . W_t + R_n W_n`` from stacked R_n, R_t, W_n, W_t, mu."""
    R_n, R_t, W_n, W_t, mu = np.split(fields, [1, 1 + d, 2 + d, 2 + 2 * d], axis=-1)
    slip = np.sqrt((W_t**2).sum(axis=-1, keepdims=True))
    bound = np.multiply(mu, np.abs(R_n) * slip, out=np.zeros_like(slip), where=slip > 0)
    total = (bound + R_n * W_n)[..., 0] + (R_t * W_t).sum(axis=-1)
    # Non-negative in exact arithmetic: what is below zero is round-off.
    return np.asarray(np.maximum(total, 0.0), np.float64)


def _shares(points: FloatArray, facets: Sequence[Block], nodes: IntArray, nodal: FloatArray) -> list[FloatArray]:
    """Split nodal values between facets in proportion to the area that each brings to the node."""
    areas = [integrals.face_mass(shape(name), points[cells]).sum(axis=2) for name, cells in facets]
    local = [_local(nodes, cells) for _, cells in facets]
    blocks = [(cells, area[:, :, None]) for cells, area in zip(local, areas, strict=True)]
    total = assembly.assemble_vector(len(nodes) + 1, 1, blocks)
    return [
        np.asarray((nodal[cells] * area / total[cells]).sum(axis=1), np.float64)
        for cells, area in zip(local, areas, strict=True)
    ]
