"""Condense an elastic problem on its contact pairs, with one factorisation of the tied bodies.

Change of variables: ``u1 = v + w`` and ``u2 = v`` on a pair. Holding w = 0 ties the bodies, so the matrix of v is that
of the tied bodies, positive definite as soon as one of them is held. Eliminating v leaves ``S w = f + r``. A stop
``c . u <= value`` is one more pair, of which only the normal counts: ``w_n = c . u``, and its gap is the value.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gibiane_ops.kernels.arrays import FloatArray
from gibiane_ops.kernels.constraints import Reduction
from gibiane_ops.kernels.contact.condensation import Condensation
from gibiane_ops.kernels.contact.fields import Fields
from gibiane_ops.kernels.contact.frames import local_frames
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.kernels.contact.tied import tied_solver
from gibiane_ops.kernels.contact.ties import tie_contact
from gibiane_ops.kernels.errors import SingularSystem, TooLarge
from gibiane_ops.kernels.products import whole_product
from gibiane_ops.kernels.solve import ITERATIVE

BoolArray = NDArray[np.bool_]

MEMORY_LIMIT = 4e9
"""Bytes that the dense interface may take when the caller sets no limit."""


def condense(
    K: sp.csr_array,
    contact: ContactPairs,
    reduction: Reduction,
    *,
    stops: sp.csr_array | None = None,
    points: FloatArray | None = None,
    method: str = "auto",
    memory_limit: float = MEMORY_LIMIT,
) -> Condensation:
    """Tie the bodies on their contact pairs and factorise them.

    Parameters
    ----------
    K : (n_dofs, n_dofs) CSR, symmetric
        Stiffness of all bodies, not constrained; component c of node i is unknown ``d i + c``.
    contact : ContactPairs
        Pairs of all zones.
    reduction : Reduction
        Conditions other than contact, from ``reduce_conditions`` with one column of prescribed values.
    stops : (n_stops, n_dofs) CSR, optional
        Unilateral conditions ``stops @ u <= value``, independent of each other and of the conditions of ``reduction``.
    points : (n_nodes, d) float64, optional
        Coordinates of the nodes, which the small model and iterations need.
    method : str
        Package, see ``factorize``.
    memory_limit : float
        Bytes that the dense interface may take.

    Returns
    -------
    Condensation

    Raises
    ------
    SingularSystem
        When the tied bodies are not held; ``nodes`` says which part moves.
    BadValue
        When pairs close a loop, so that their relative displacements are not independent.
    ContradictoryConditions
        When a linear relation holds a relative displacement alone, other than component by component, or a stop acts
        on what the conditions or another stop already hold.
    TooLarge
        When the dense interface would take more than ``memory_limit``.

    Notes
    -----
    ``S = Kww - Kwv Kvv^-1 Kvw``. A pair component prescribed on both sides is dropped; prescribed on one side only, it
    stays and the other side moves. Whatever the side, the force that does work on w is that on body 1.

    Cost
    ----
    One factorisation.
    """
    d = contact.normals.shape[1]
    n_dofs = K.shape[0]
    n_stops = 0 if stops is None else stops.shape[0]
    needed = interface_memory(len(contact.pairs) + n_stops, d)
    if needed > memory_limit:
        raise TooLarge(f"the dense interface of {len(contact.pairs) + n_stops} pairs", needed, memory_limit)
    Bv, Bw, B0, free = tie_contact(n_dofs, d, contact, reduction.fixed)
    frames, active, shortening = local_frames(contact.normals, free)
    Bw = sp.csr_array(Bw @ _to_global(frames, active))
    if stops is not None and n_stops:
        Bw = sp.hstack([Bw, sp.csr_array((n_dofs, n_stops * d))], format="csr")
        frames = np.concatenate([frames, np.broadcast_to(np.eye(d), (n_stops, d, d))])
        active = np.concatenate([active, np.broadcast_to(np.arange(d) == 0, (n_stops, d))])
    fields = Fields.of(Bv, Bw, B0, reduction, stops, d)
    KBw = sp.csr_array(K @ fields.Bw)
    Kvw = sp.csr_array(fields.Bv.T @ KBw)
    try:
        roots = fields.roots() if method in ITERATIVE else None
        tied = tied_solver(whole_product(fields.Bv, K), method=method, roots=roots, points=points)
    except SingularSystem as error:
        moving = np.unique(fields.Bv[:, error.unknowns].nonzero()[0])
        raise SingularSystem(f"tied bodies: {error.message}", np.unique(moving // d), moving) from error
    return Condensation(
        contact, tied, frames, active, n_stops, shortening, K, KBw, Kvw, fields, reduction, points
    )  # fmt: skip


def interface_memory(n_pairs: int, dim: int) -> float:
    """Predict the memory of the dense interface: S, its scaled copies and the matrix of a Newton step.

    Parameters
    ----------
    n_pairs, dim : int

    Returns
    -------
    float
        Bytes.
    """
    return 5 * 8.0 * (n_pairs * dim) ** 2


def _to_global(frames: FloatArray, active: BoolArray) -> sp.csr_array:
    """Give the matrix from active local components to global ones, block diagonal."""
    n, d = active.shape
    if not n:
        return sp.csr_array((0, 0))
    blocks = np.where(active[:, None, :], np.swapaxes(frames, 1, 2), 0.0)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * d, n * d)).tocsr()
