"""Every admissible displacement of tied bodies and their relative displacements, under linear conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.constraints import Reduction, reduce_conditions


@dataclass(frozen=True, eq=False)
class Fields:
    """Every admissible displacement, ``U = Bv x + Bw w + constant``, w in local components.

    Attributes
    ----------
    Bv : (n_dofs, n_v) csr_array
    Bw : (n_dofs, n d) csr_array
    B0 : (n_dofs, n_fixed) csr_array
    fixed, tied : (k,) int64
        Unknowns of the conditions, see ``Reduction``.
    relations : (n_relations, n_dofs) csr_array
    tie_matrix : (n_dofs, n_tie) csr_array
        Bv without the relations.
    """

    Bv: sp.csr_array
    Bw: sp.csr_array
    B0: sp.csr_array
    fixed: IntArray
    tied: IntArray
    relations: sp.csr_array
    tie_matrix: sp.csr_array

    @staticmethod
    def of(
        Bv: sp.csr_array, Bw: sp.csr_array, B0: sp.csr_array, reduction: Reduction, stops: sp.csr_array | None, d: int
    ) -> Fields:
        """Add the linear relations, ``u[tied] = relation u[free] + offset[tied]``, as conditions on v given w.

        A stop adds ``c . u = w_n``, w_n being the first component of its pair, and the pairs of stops are the last.
        """
        n_dofs, tied = reduction.n, reduction.tied
        select = sp.eye_array(n_dofs, format="csr")
        relations = sp.csr_array(select[tied] - reduction.relation @ select[reduction.free])
        unit = sp.csr_array((len(tied), Bw.shape[1]))
        if stops is not None and stops.shape[0]:
            n_stops = stops.shape[0]
            own = sp.csr_array(
                (np.ones(n_stops), (np.arange(n_stops), Bw.shape[1] - d * np.arange(n_stops, 0, -1))),
                (n_stops, Bw.shape[1]),
            )
            relations, unit = sp.vstack([relations, stops], format="csr"), sp.vstack([unit, own], format="csr")
        if not relations.shape[0]:
            return Fields(Bv, Bw, B0, reduction.fixed, tied, relations, Bv)
        right = sp.csc_array(unit - relations @ Bw)
        touched = np.flatnonzero(np.diff(right.indptr))
        if not len(touched):
            touched = np.zeros(1, np.int64)  # relations away from contact: one column of zeros
        second = reduce_conditions(relations @ Bv, right[:, touched].toarray())
        chosen = sp.eye_array(Bv.shape[1], format="csr")
        T = chosen[:, second.free] + chosen[:, second.tied] @ second.relation
        follow = sp.csr_array(second.offset) @ sp.eye_array(Bw.shape[1], format="csr")[touched]
        return Fields(
            sp.csr_array(Bv @ T), sp.csr_array(Bw + Bv @ follow), B0, reduction.fixed, tied, relations, Bv
        )  # fmt: skip

    def constant(self, offset: FloatArray) -> FloatArray:
        """Compute the displacement at x = 0 and w = 0."""
        U0 = np.asarray(self.B0 @ offset[self.fixed])
        if self.relations.shape[0]:
            values = np.zeros(self.relations.shape[0])
            values[: len(self.tied)] = offset[self.tied]
            rest = values - self.relations @ U0
            U0 = U0 + self.tie_matrix @ reduce_conditions(self.relations @ self.tie_matrix, rest).offset
        return U0

    def roots(self) -> IntArray:
        """Find, for each x, an unknown that equals it whatever w is (the first), or -1.

        Returns
        -------
        (n_v,) int64
        """
        n_dofs, n_v = self.Bv.shape
        alone = np.flatnonzero(np.diff(self.Bv.indptr) == 1)
        first = self.Bv.indptr[alone]
        alone, first = alone[self.Bv.data[first] == 1.0], first[self.Bv.data[first] == 1.0]
        found = np.full(n_v, n_dofs)
        np.minimum.at(found, self.Bv.indices[first], alone)
        return np.where(found < n_dofs, found, -1)
