"""RIGIDITE: stiffness matrices, conditions on unknowns, and contact conditions, kept as separate parts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from gibiane.values import RIGIDITE, Value
from gibiane_ops.kernels.contact.law import Friction
from gibiane_ops.kernels.contact.pairs import ContactPairs
from gibiane_ops.values.champs import MChaml
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.modele import ContactZone, Modele
from gibiane_ops.values.nodes import FloatArray, IntArray


class MatrixPart:
    """A matrix on the unknowns `names` of `nodes` (sorted): row `d i + c` is name c of node i.

    `mesh` holds the elements that it came from: contact looks there on which side of a surface its solid lies.
    `symmetric` is false for some matrices made by hand; `origin` is the model and the material of a stiffness, from
    which that of fewer elements can be made.
    """

    symmetric: bool = True
    origin: tuple[Modele, MChaml] | None = None

    def __init__(
        self,
        nodes: IntArray,
        names: Sequence[str],
        duals: Sequence[str],
        matrix: sp.csr_array,
        mesh: Maillage | None = None,
    ) -> None:
        self.nodes = nodes
        self.names = tuple(names)
        self.duals = tuple(duals)
        self.matrix = matrix
        self.mesh = mesh


class ConditionTerms(NamedTuple):
    """Rows, nodes, unknowns and factors of a few conditions, (k,) each."""

    row: IntArray
    node: IntArray
    name: Any
    coefficients: FloatArray


class ConditionPart:
    """Linear conditions, one row each: sum of `coefficients` times unknowns `=`, `<` or `>` a value.

    Attributes
    ----------
    row, node : (k,) int64
        Row and node of each term.
    name : (k,) array of str
        Unknown of each term.
    coefficients : (k,) float64
    multipliers : (n_rows,) int64
        One node of the session per row: carries the value imposed (FLX) and the multiplier found (LX).
    sense : str
        "=", "<" (at most) or ">" (at least).
    label : str
        What the user wrote, for messages (BLOQ UX).
    line : int
        Line of the instruction that made them, 0 when unknown.
    reactions : ConditionTerms
        Where the multipliers act: row, node, unknown and factor, like the terms of the conditions; these themselves
        unless RELA 'DUAL' gave others, which makes the system unsymmetric.
    """

    own_reactions: ConditionTerms | None = None

    def __init__(
        self,
        row: IntArray,
        node: IntArray,
        name: Any,
        coefficients: FloatArray,
        multipliers: IntArray,
        sense: str,
        label: str,
        line: int = 0,
    ) -> None:
        self.row = row
        self.node = node
        self.name = np.asarray(name)
        self.coefficients = coefficients
        self.multipliers = multipliers
        self.sense = sense
        self.label = label
        self.line = line

    @property
    def reactions(self) -> ConditionTerms:
        """The terms that the multipliers act on."""
        return self.own_reactions or self.terms

    @property
    def terms(self) -> ConditionTerms:
        """The terms of the conditions."""
        return ConditionTerms(self.row, self.node, self.name, self.coefficients)

    @property
    def origin(self) -> str:
        """The label and the line where it was written."""
        return f"{self.label} (line {self.line})" if self.line else self.label


class ContactPart:
    """Contact conditions of one zone: node pairs, friction, and one multiplier node per pair.

    Attributes
    ----------
    zone : ContactZone
    pairs : ContactPairs
        With nodes of the session; the gap used is the one of the second member (FLX on `multipliers`).
    law : Friction
        Friction of the pairs, in nodal forces.
    multipliers : (n_pairs,) int64
        One node of the session per pair: carries its gap (FLX) and the normal force found (LX).
    vectors : (n_pairs, d) int64
        One node per pair and axis: carries the contact force on the slave along this axis (LX).
    """

    def __init__(
        self, zone: ContactZone, pairs: ContactPairs, law: Friction, multipliers: IntArray, vectors: IntArray
    ) -> None:
        self.zone = zone
        self.pairs = pairs
        self.law = law
        self.multipliers = multipliers
        self.vectors = vectors


Part = MatrixPart | ConditionPart | ContactPart


class Rigidite(Value):
    """A list of parts; ET joins the lists. Nodes are those of the session."""

    type_name = RIGIDITE

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = list(parts)

    @property
    def matrices(self) -> list[MatrixPart]:
        """The stiffness matrices."""
        return [p for p in self.parts if isinstance(p, MatrixPart)]

    @property
    def conditions(self) -> list[ConditionPart]:
        """The conditions on unknowns."""
        return [p for p in self.parts if isinstance(p, ConditionPart)]

    @property
    def contacts(self) -> list[ContactPart]:
        """The contact conditions."""
        return [p for p in self.parts if isinstance(p, ContactPart)]

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield f" RIGIDITE de pointeur {session.ordinal(self)}"
        for part in self.parts:
            if isinstance(part, MatrixPart):
                yield f" matrice : {len(part.nodes)} noeud(s), inconnues {' '.join(part.names)}"
            elif isinstance(part, ConditionPart):
                yield f" conditions {part.label} : {len(part.multipliers)} relation(s) {part.sense}"
            else:
                yield f" contact : {len(part.multipliers)} paire(s) de noeuds"
