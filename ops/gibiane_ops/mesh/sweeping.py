"""Layers of nodes swept by a line or a surface, mid-nodes included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gibiane.registry import Context
from gibiane_ops.kernels import topology
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.mesh.building import nodes_of
from gibiane_ops.mesh.degree import linear_mesh, wants_quadratic
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.middles import middles_of


@dataclass(frozen=True, eq=False)
class Base:
    """What is swept.

    Attributes
    ----------
    mesh : Maillage
        Of first degree.
    corners : (n,) int64
        Its nodes, sorted.
    ends : (k, 2) int64
        Its edges, by ranks of corners; none in first degree.
    middles : (k,) int64
        Their mid-nodes.
    quadratic : bool
        Whether mid-nodes are wanted.
    """

    mesh: Maillage
    corners: IntArray
    ends: IntArray
    middles: IntArray
    quadratic: bool

    @property
    def places(self) -> FloatArray:
        """Coordinates of the corners, then of the mid-nodes, (n + k, 3), length."""
        return np.asarray(self.mesh.store.coords[np.concatenate([self.corners, self.middles])], np.float64)


def base_of(ctx: Context, given: Maillage) -> Base:
    """Return the nodes of a line or surface to sweep, with its mid-nodes when it has them or OPTI ELEM wants them."""
    quadratic = wants_quadratic(ctx, given)
    mesh = linear_mesh(ctx, given)
    corners = mesh.nodes
    edges = topology.edges(mesh.kernel_blocks) if quadratic else np.zeros((0, 2), np.int64)
    return Base(mesh, corners, np.searchsorted(corners, edges), middles_of(ctx).of(edges), quadratic)


def add_layers(
    ctx: Context,
    base: Base,
    place: Callable[[float], FloatArray],
    places: FloatArray,
    sizes: tuple[float, float],
    end: IntArray | None = None,
) -> IntArray:
    """Add the nodes of the layers after the first.

    Parameters
    ----------
    ctx : Context
    base : Base
    place : callable
        ``place(t) -> (n + k, 3)`` gives the images of ``base.places``.
    places : (n_layers + 1,) float64
        Parameters of the layers.
    sizes : tuple of float, length
        Densities of the first and the last layer.
    end : (n,) int64, optional
        Corners of the last layer if they exist.

    Returns
    -------
    (n_layers + 1, n) int64
        Corners of the layers. Mid-nodes are made on the images of the edges and half-way between the layers.
    """
    store, n = nodes_of(ctx), len(base.corners)
    inner = places[1:] if end is None else places[1:-1]
    span = places[-1] - places[0]
    images = np.array([place(float(t)) for t in inner]).reshape(len(inner), n + len(base.middles), 3)
    density = sizes[0] + (inner - places[0]) / span * (sizes[1] - sizes[0])
    layers = [base.corners[None]]
    if len(inner):
        layers.append(store.add(images[:, :n].reshape(-1, 3), np.repeat(density, n)).reshape(-1, n))
    if end is not None:
        layers.append(end[None])
    ids = np.concatenate(layers)
    if base.quadratic:
        middles = middles_of(ctx)
        across = ids[1 : len(inner) + 1][:, base.ends].reshape(-1, 2)
        # Edges that the sweep does not move have the mid-node of the base.
        moved = np.flatnonzero(across[:, 0] != across[:, 1])
        middles.add(across[moved], images[:, n:].reshape(-1, 3)[moved])
        half = np.concatenate([place(float(t))[:n] for t in (places[1:] + places[:-1]) / 2])
        along = np.stack([ids[:-1].ravel(), ids[1:].ravel()], axis=1)
        middles.add(along, half)
    return ids
