"""Combination of the solid and contact parts of the error into relative errors and a map by element."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.estimate.zz import SolidError
from gibiane_ops.kernels.topology import Block, faces_of, group_by_nodes

NORMS = ("USUE", "THES")


@dataclass(frozen=True, eq=False)
class RelativeError:
    """Relative errors of the whole and of each element.

    Attributes
    ----------
    solid, contact, total : float
        ``total^2 = solid^2 + contact^2``.
    absolute : float, square root of an energy
        Numerator of `total`.
    energy : float
        ``|s_h|^2`` of all the solids.
    solid_map, contact_map : list of (m,) float64
        Relative contribution of each element, one array a block; the squares add up to `solid` and `contact` squared.
    """

    solid: float
    contact: float
    total: float
    absolute: float
    energy: float
    solid_map: list[FloatArray]
    contact_map: list[FloatArray]

    @property
    def total_map(self) -> list[FloatArray]:
        """Relative contribution of each element, ``sqrt(solid^2 + contact^2)``."""
        return [np.hypot(s, c) for s, c in zip(self.solid_map, self.contact_map, strict=True)]


def combine(solids: Sequence[SolidError], contacts: Sequence[FloatArray] = (), norm: str = "USUE") -> RelativeError:
    """Form the relative errors.

    Parameters
    ----------
    solids : list of SolidError
        One for each block of cells, all solids together.
    contacts : list of (m,) float64, energy
        Squared contact error of each cell of these blocks, see `facets_to_cells`; empty without contact.
    norm : {'USUE', 'THES'}
        Denominator: ``|s_h|^2 + e^2``, or ``|s* + s_h|^2``.

    Returns
    -------
    RelativeError

    Raises
    ------
    BadValue
        Unknown norm.

    Notes
    -----
    ``e^2 = e_solid^2 + e_contact^2``. The denominator of THES is about ``4 |s_h|^2``: its percentages are about half
    of those of USUE. Without any stress every error is 0.

    Source
    ------
    USUE: Zienkiewicz and Zhu 1987. THES: Ladeveze's relative error with the smoothed stress as admissible field, as
    in Becheur, Tahakourt and Coorevits 2008.
    """
    if norm not in NORMS:
        raise BadValue("norm", norm, f"one of {' '.join(NORMS)}")
    parts = list(contacts) or [np.zeros_like(each.error) for each in solids]
    solid2 = float(sum(each.error.sum() for each in solids))
    contact2 = float(sum(each.sum() for each in parts))
    energy = float(sum(each.energy.sum() for each in solids))
    sums = float(sum(each.sum_energy.sum() for each in solids))
    denominator = sums if norm == "THES" else energy + solid2 + contact2
    scale = 1.0 / np.sqrt(denominator) if denominator > 0 else 0.0
    return RelativeError(
        float(np.sqrt(solid2) * scale),
        float(np.sqrt(contact2) * scale),
        float(np.sqrt(solid2 + contact2) * scale),
        float(np.sqrt(solid2 + contact2)),
        energy,
        [np.sqrt(each.error) * scale for each in solids],
        [np.sqrt(each) * scale for each in parts],
    )


def owners(blocks: Sequence[Block], facets: IntArray, name: str) -> IntArray:
    """Find the cell that has each facet of a list on its boundary.

    Parameters
    ----------
    blocks : list of (str, (m, n_nodes) int64)
    facets : (k, n) int64
        Facets of one shape, nodes in any order.
    name : str
        Their shape.

    Returns
    -------
    (k,) int64
        Number of the first such cell, counted through the blocks; -1 when there is none.
    """
    found = faces_of(blocks).get(name)
    if found is None:
        return np.full(len(facets), -1, np.int64)
    corners = shape(name).n_corners
    group, _ = group_by_nodes(np.vstack([found.nodes, facets])[:, :corners])
    mine, theirs = group[len(found.nodes) :], group[: len(found.nodes)]
    cell = np.full(int(group.max(initial=0)) + 1, -1, np.int64)
    cell[theirs[::-1]] = found.cell[::-1]
    return cell[mine]


def facets_to_cells(
    blocks: Sequence[Block],
    facets: Sequence[Block],
    values: Sequence[FloatArray],
    partner: IntArray | None = None,
) -> list[FloatArray]:
    """Share the contact error of each facet between the cells on its two sides.

    Parameters
    ----------
    blocks : list of (str, (m, n_nodes) int64)
        Cells of all the solids.
    facets : list of (str, (m, n) int64)
        Facets of body 1.
    values : list of (m,) float64, energy
        Squared error of each facet.
    partner : (n_points,) int64, optional
        Node of body 2 facing each node of body 1 (any value elsewhere). Without it the facet has one side only.

    Returns
    -------
    list of (m,) float64, energy
        For each block of cells. Half to each side; all to body 1 where body 2 has no such facet.
    """
    sizes = [len(cells) for _, cells in blocks]
    total = np.zeros(sum(sizes))
    for (name, nodes), value in zip(facets, values, strict=True):
        first = owners(blocks, nodes, name)
        second = np.full_like(first, -1) if partner is None else owners(blocks, partner[nodes], name)
        second = np.where(second < 0, first, second)
        for side in (first, second):
            known = side >= 0
            total += np.bincount(side[known], 0.5 * value[known], minlength=len(total))
    return np.split(total, np.cumsum(sizes)[:-1])
