"""MMODEL: zones of elements with a formulation, and contact zones between two surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gibiane.values import MMODEL, Value
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import IntArray

DISPLACEMENTS = {"TRID": ("UX", "UY", "UZ"), "PLAN": ("UX", "UY"), "AXIS": ("UR", "UZ")}
FORCES = {"TRID": ("FX", "FY", "FZ"), "PLAN": ("FX", "FY"), "AXIS": ("FR", "FZ")}
STRAINS = {
    "TRID": ("EPXX", "EPYY", "EPZZ", "GAXY", "GAXZ", "GAYZ"),
    "PLAN": ("EPXX", "EPYY", "EPZZ", "GAXY"),
    "AXIS": ("EPRR", "EPZZ", "EPTT", "GARZ"),
    "BARR": ("EPSS",),
}
STRESSES = {
    "TRID": ("SMXX", "SMYY", "SMZZ", "SMXY", "SMXZ", "SMYZ"),
    "PLAN": ("SMXX", "SMYY", "SMZZ", "SMXY"),
    "AXIS": ("SMRR", "SMZZ", "SMTT", "SMRZ"),
    "BARR": ("EFFX",),
}


DUALS = {"UX": "FX", "UY": "FY", "UZ": "FZ", "UR": "FR", "UT": "FT", "RX": "MX", "RY": "MY", "RZ": "MZ", "RT": "MT"} | {
    "T": "Q", "LX": "FLX", "P": "FP", "PI": "FPI", "ALFA": "FALF", "BETA": "FBET"
}  # fmt: skip


def dual_of(name: str) -> str:
    """Return the name of the force that goes with an unknown; F and its first letters where none is settled."""
    return DUALS.get(name, f"F{name}"[:4])


class ModelZone:
    """Elements of one type with one formulation and law, in one calculation mode.

    Attributes
    ----------
    mesh : Maillage
        One block.
    formulation : str
        MECANIQUE (others later).
    law : tuple of str
        E.g. ("ELASTIQUE", "ISOTROPE"), ("ELASTIQUE", "ORTHOTROPE"), ("ELASTIQUE", "ISOTROPE", "BARR").
    mode : str
        TRID, "PLAN DEFO", "PLAN CONT" or AXIS.
    """

    def __init__(self, mesh: Maillage, formulation: str, law: tuple[str, ...], mode: str) -> None:
        self.mesh = mesh
        self.formulation = formulation
        self.law = law
        self.mode = mode

    @property
    def shape(self) -> str:
        """Element type."""
        return self.mesh.blocks[0].shape

    @property
    def cells(self) -> IntArray:
        """Elements, (m, n_nodes)."""
        return self.mesh.blocks[0].cells

    @property
    def family(self) -> str:
        """Key of the tables of names: TRID, PLAN or AXIS."""
        return self.mode[:4]

    @property
    def dim(self) -> int:
        """Number of coordinates that the kernels use."""
        return 3 if self.family == "TRID" else 2

    @property
    def axisymmetric(self) -> bool:
        """Whether the mesh is the meridian section of a body of revolution."""
        return self.family == "AXIS"

    @property
    def bars(self) -> bool:
        """Whether the elements are lines that resist stretching only."""
        return "BARR" in self.law

    @property
    def orthotropic(self) -> bool:
        """Whether the elastic law has directions."""
        return "ORTHOTROPE" in self.law

    @property
    def strains(self) -> tuple[str, ...]:
        """Names of the strains."""
        return STRAINS["BARR" if self.bars else self.family]

    @property
    def stresses(self) -> tuple[str, ...]:
        """Names of the stresses, or of the forces in bars."""
        return STRESSES["BARR" if self.bars else self.family]


class ContactZone:
    """A pair of surfaces that may touch.

    Attributes
    ----------
    master, slave : Maillage
        First and second surface (GEO1, GEO2); no slave node may cross a master facet. The slave belongs to body 1.
    law : str
        UNILATERAL (no friction), COULOMB, TRESCA, REGULARISE (elastic slip) or NORTON.
    kinematics : str
        MESC, SYME, FAIB, MORT or NOEU; all are node pairs where nodes coincide.
    rigid : bool
        The master is an obstacle that belongs to no solid and has no unknowns.
    """

    def __init__(self, master: Maillage, slave: Maillage, law: str, kinematics: str, rigid: bool = False) -> None:
        self.master = master
        self.slave = slave
        self.law = law
        self.kinematics = kinematics
        self.rigid = rigid


class Modele(Value):
    """A model: zones of solids, contact zones, surfaces under pressure (`loads`), zones of heat (`heated`)."""

    type_name = MMODEL

    def __init__(
        self,
        zones: Sequence[ModelZone],
        contacts: Sequence[ContactZone] = (),
        loads: Sequence[ModelZone] = (),
        heated: Sequence[ModelZone] = (),
    ) -> None:
        self.zones = list(zones)
        self.contacts = list(contacts)
        self.loads = list(loads)
        self.heated = list(heated)

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" MMODEL de pointeur {session.ordinal(self)}"
        for number, zone in enumerate(self.zones, 1):
            yield (
                f" zone {number} : {zone.mesh.n_cells} element(s) {zone.shape}, {zone.formulation} "
                f"{' '.join(zone.law)}, mode {zone.mode}"
            )
        for number, zone in enumerate(self.heated, 1):
            yield (
                f" thermique {number} : {zone.mesh.n_cells} element(s) {zone.shape}, {' '.join(zone.law)}, "
                f"mode {zone.mode}"
            )
        for number, zone in enumerate(self.loads, 1):
            yield f" chargement {number} : {zone.mesh.n_cells} element(s) {zone.shape}, PRESSION, mode {zone.mode}"
        for number, pair in enumerate(self.contacts, 1):
            yield f" contact {number} : {pair.slave.n_cells} facette(s) sur {pair.master.n_cells}, {pair.law}"
