"""Exceptions raised by the kernels: each carries data, the operators turn it into words for the user."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def _first(ids: IntArray, limit: int = 5) -> str:
    """Show the first few ids and, when there are more, their number."""
    shown = ", ".join(str(int(i)) for i in ids[:limit])
    return shown if len(ids) <= limit else f"{shown}, ... ({len(ids)} in all)"


class KernelError(Exception):
    """Base of every failure that a user's data can cause in a kernel."""


@dataclass(eq=False)
class InvertedElement(KernelError):
    """Elements whose Jacobian is zero or negative at an integration point.

    Attributes
    ----------
    shape : str
        Name of the reference shape.
    ids : (k,) int64
        Positions of the elements in the block, 0-based.
    volumes : (k,) float64
        Smallest Jacobian determinant found in each of them.
    corners : (k, n_nodes, dim) float64
        Coordinates of their nodes.
    """

    shape: str
    ids: IntArray
    volumes: FloatArray
    corners: FloatArray

    def __str__(self) -> str:
        return f"{self.shape}: inverted or flat elements {_first(self.ids)}, smallest jacobian {self.volumes.min():g}"


@dataclass(eq=False)
class BadValue(KernelError):
    """A number outside the range where the formula holds.

    Attributes
    ----------
    what : str
        Name of the quantity.
    value : object
        What was given.
    limit : str
        The condition that it breaks, e.g. ``-1 < nu < 0.5``.
    """

    what: str
    value: object
    limit: str

    def __str__(self) -> str:
        return f"{self.what} = {self.value}: {self.limit} is needed"


@dataclass(eq=False)
class ContradictoryConditions(KernelError):
    """Equality conditions that no field can satisfy together.

    Attributes
    ----------
    rows : (k,) int64
        Conditions of the contradictory group: the offending row and those that it contradicts.
    residual : float
        What is left of the right-hand side of the offending row when its left side vanishes.
    """

    rows: IntArray
    residual: float

    def __str__(self) -> str:
        return f"conditions {_first(self.rows)} contradict each other by {self.residual:g}"


@dataclass(eq=False)
class SingularSystem(KernelError):
    """A matrix that could not be factorised, or whose solution is meaningless.

    Attributes
    ----------
    message : str
        What the solver saw.
    nodes : (k,) int64
        Nodes of the suspicious unknowns, empty when unknown.
    unknowns : (k,) int64
        Positions of the suspicious unknowns, empty when unknown.
    """

    message: str
    nodes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    unknowns: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))

    def __str__(self) -> str:
        return self.message


@dataclass(eq=False)
class NotConverged(KernelError):
    """An iteration that did not reach its tolerance.

    Attributes
    ----------
    history : list of float
        Residual after each iteration.
    best : object
        The best iterate, so that the caller may accept, retry or report.
    reason : str
        What stopped the iteration, when it is not their number: ``wavering`` (``count`` statuses change back and
        forth), ``laws`` (broken by ``size``) or ``inner`` (problem ``number`` is not solved in ``steps``).
    fields : mapping of str to object
        The numbers of the reason.
    """

    history: list[float]
    best: object = None
    reason: str = ""
    fields: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        last = f", last residual {self.history[-1]:g}" if self.history else ""
        last += f", {self.reason} {dict(self.fields)}" if self.reason else ""
        return f"no convergence after {len(self.history)} iterations{last}"


@dataclass(eq=False)
class EmptyContact(KernelError):
    """A contact zone in which no pair could be made.

    Attributes
    ----------
    reason : str
        Why no pair was kept.
    """

    reason: str

    def __str__(self) -> str:
        return f"no contact pair: {self.reason}"


@dataclass(eq=False)
class MeshingFailed(KernelError):
    """A mesher that returned no usable mesh.

    Attributes
    ----------
    reason : str
        What the mesher said.
    """

    reason: str

    def __str__(self) -> str:
        return f"meshing failed: {self.reason}"


@dataclass(eq=False)
class MissingPackage(KernelError):
    """An optional Python package that is not installed.

    Attributes
    ----------
    package : str
        Import name.
    install : str
        Command that installs it.
    """

    package: str
    install: str

    def __str__(self) -> str:
        return f"package {self.package} is missing; {self.install}"


@dataclass(eq=False)
class MissingSystemLibrary(KernelError):
    """A shared library that an installed package needs and does not find.

    Attributes
    ----------
    library : str
        File name of the library.
    debian_package : str
        Debian package that holds it.
    """

    library: str
    debian_package: str

    def __str__(self) -> str:
        return f"library {self.library} is missing; on Debian: apt install {self.debian_package}"


@dataclass(eq=False)
class ContactUnbalanced(KernelError):
    """A body that only contact holds, under a load that no admissible contact force can balance.

    Attributes
    ----------
    kind : str
        ``sliding``, ``tipping`` or ``separation``.
    share : float
        Unbalanced part of the load over the load on the free motions.
    motion : (n_pairs, d) float64
        Relative rigid motion that starts, in local components, largest entry 1.
    history : list of float
        Residuals of the attempt.
    best : object
        The best state reached; it does not satisfy the laws.
    """

    kind: str
    share: float
    motion: FloatArray
    history: list[float]
    best: object = None

    def __str__(self) -> str:
        return f"hypostatic ({self.kind}): the contact cannot balance {self.share:.2%} of the load on the free motions"


@dataclass(eq=False)
class StatusCycle(KernelError):
    """Contact statuses that come back without converging.

    Attributes
    ----------
    period : int
        Number of iterations between two equal sets of statuses.
    pairs : (k,) int64
        Pairs whose status changes within the period.
    history : list of float
        Criterion after each iteration.
    best : object
        Last state.
    """

    period: int
    pairs: IntArray
    history: list[float]
    best: object = None

    def __str__(self) -> str:
        return f"statuses of pairs {_first(self.pairs)} come back every {self.period} iterations without converging"


@dataclass(eq=False)
class UnsupportedLaw(KernelError):
    """A contact method given a law that it cannot treat.

    Attributes
    ----------
    method : str
        Name of the method.
    known : str
        Laws that it treats.
    """

    method: str
    known: str

    def __str__(self) -> str:
        return f"{self.method} treats {self.known} only"


@dataclass(eq=False)
class TooLarge(KernelError):
    """A computation whose predicted memory exceeds the limit.

    Attributes
    ----------
    what : str
        What would fill the memory.
    needed, limit : float
        Bytes.
    """

    what: str
    needed: float
    limit: float

    def __str__(self) -> str:
        return f"{self.what} would need {self.needed / 1e9:.3g} GB, the limit is {self.limit / 1e9:.3g} GB"


@dataclass(eq=False)
class NotEquilibrated(KernelError):
    """A finite-element stress that does not balance the loads given with it.

    Attributes
    ----------
    nodes : (k,) int64
        Nodes where forces remain, the largest first.
    forces : (k, d) float64
        What remains there.
    share : float
        The largest of them over the largest nodal force of the stress.
    """

    nodes: IntArray
    forces: FloatArray
    share: float

    def __str__(self) -> str:
        return f"the stress leaves {self.share:.2%} of unbalanced force at nodes {_first(self.nodes)}"


@dataclass(eq=False)
class UnreadableFile(KernelError):
    """A file of another format than expected, or one that was cut.

    Attributes
    ----------
    path : str
    reason : str
        What is wrong with it.
    """

    path: str
    reason: str

    def __str__(self) -> str:
        return f"{self.path}: {self.reason}"
