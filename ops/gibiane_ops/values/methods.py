"""Contact methods by their keywords."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gibiane_ops.kernels.contact.augmented import solve_augmented_newton, solve_uzawa
from gibiane_ops.kernels.contact.bipotential import solve_bipotential
from gibiane_ops.kernels.contact.gauss_seidel import solve_gauss_seidel
from gibiane_ops.kernels.contact.interface import Interface
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.multipliers import solve_multipliers
from gibiane_ops.kernels.contact.newton import solve_coulomb
from gibiane_ops.kernels.contact.outcome import accepted
from gibiane_ops.kernels.contact.penalty import solve_penalty
from gibiane_ops.kernels.contact.projected_cg import solve_projected_cg
from gibiane_ops.kernels.contact.report import ContactState
from gibiane_ops.kernels.contact.status import solve_statuses
from gibiane_ops.kernels.contact.tresca import solve_tresca_sequence
from gibiane_ops.kernels.errors import UnsupportedLaw
from gibiane_ops.values.nodes import FloatArray

# keyword and what it is; those of WITH_R take a number r, a multiple of the stiffness of the interface
PLAIN = {
    "NEWT": "exact, semi-smooth Newton",
    "KRYL": "the same without condensation, by iterations",
    "TRES": "sequence of Tresca problems",
    "MULT": "multipliers and active set",
    "PROJ": "projected Gauss-Seidel",
    "PCG": "projected conjugate gradients, without friction",
}
WITH_R = {
    "PENA": "penalty",
    "PERT": "perturbed Lagrangian",
    "AUGM": "augmented Lagrangian by Newton",
    "UZAW": "augmented Lagrangian by Uzawa",
    "BIPO": "bipotential",
}
STATUSES = "STATUT"
OWN_LAW = ("PENA", "PERT")

_MATRICES = {
    "PENA": "springs", "UZAW": "springs", "PERT": "perturbed", "MULT": "saddle", "BIPO": "shifted", "PROJ": "shifted",
    "PCG": "shifted",
}  # fmt: skip

_SOLVERS: dict[str, Callable[..., ContactState]] = {
    "NEWT": solve_coulomb,
    "KRYL": solve_coulomb,
    "TRES": solve_tresca_sequence,
    "MULT": solve_multipliers,
    "PROJ": solve_gauss_seidel,
    "PCG": solve_projected_cg,
    "PENA": solve_penalty,
    "PERT": lambda interface, law, r, **options: solve_multipliers(interface, law, perturbation=r, **options),
    "AUGM": solve_augmented_newton,
    "UZAW": solve_uzawa,
    "BIPO": solve_bipotential,
    STATUSES: solve_statuses,
}


@dataclass(frozen=True)
class Method:
    """A contact method with the numbers that the user gave it.

    Attributes
    ----------
    name : str
        Keyword.
    r : float or None
        Penalty or parameter, a multiple of the stiffness of the interface.
    thresholds : tuple of (float or None)
        Closing distance, sticking distance (lengths) and tolerance of STATUT.
    tolerance : float or None
    max_iter : int or None
    """

    name: str = "NEWT"
    r: float | None = None
    thresholds: tuple[float | None, ...] = (None, None, None)
    tolerance: float | None = None
    max_iter: int | None = None

    @property
    def title(self) -> str:
        """The keyword with its number."""
        return self.name if self.r is None else f"{self.name} {self.r:g}"

    @property
    def krylov(self) -> bool:
        """Whether the interface must not be condensed."""
        return self.name == "KRYL"

    @property
    def is_newton(self) -> bool:
        """Whether it is the exact semi-smooth Newton method."""
        return self.name in ("NEWT", "KRYL")

    @property
    def approximate(self) -> bool:
        """Whether its result obeys another law than the exact one."""
        return self.name in (*OWN_LAW, STATUSES)

    @property
    def matrix(self) -> str:
        """The matrix that it factorises, as ``condensed_condition`` names it, or ``springs``."""
        return _MATRICES.get(self.name, "newton")

    def solve_exact(self, interface: Interface, law: Friction, slip_origin: FloatArray | None) -> ContactState:
        """Run the exact method instead."""
        return solve_coulomb(interface, law, slip_origin=slip_origin)

    def solve(self, interface: Interface, law: Friction, **more: Any) -> ContactState:
        """Run the method; `more` holds `start` and `slip_origin` (those that the method knows are passed on).

        A result that breaks the exact laws is refused, unless the method obeys a law of its own.
        """
        options: dict[str, Any] = {}
        if self.name == STATUSES:
            if more.get("slip_origin") is not None:
                raise UnsupportedLaw("the fixed point of statuses", "a single load step")
            closing, sticking, tolerance = self.thresholds
            options = {"closing_distance": closing, "sticking_distance": sticking, "tolerance": tolerance}
        else:
            options = dict(more)
            if self.name == "PCG":
                options.pop("slip_origin", None)
        if self.tolerance is not None:
            options["tolerance"] = self.tolerance
        if self.max_iter is not None:
            options["max_iter"] = self.max_iter
        options = {name: value for name, value in options.items() if value is not None}
        given = () if self.r is None else (self.r,)
        state = _SOLVERS[self.name](interface, law, *given, **options)
        return state if self.approximate else accepted(state, self.tolerance)
