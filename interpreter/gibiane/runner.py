"""What control instructions, procedures and objects ask of the evaluator, which stands above them."""

from __future__ import annotations

from typing import Any, Protocol

from gibiane.binding import Operands
from gibiane.frames import Frame
from gibiane.nodes import Instr, Node
from gibiane.source import SourceText
from gibiane.values import Procedure


class Runner(Protocol):
    """The evaluator as the modules below it see it; :class:`gibiane.evaluator.Evaluator` is the one there is.

    Attributes
    ----------
    session : Session
        Options, output, library, names of the session.
    frame : Frame
        Names and loops of the current call.
    current : Instr or None
        The instruction being run.
    closures : bool
        Whether closures may stand in for the queue machine.
    """

    session: Any
    frame: Frame
    current: Instr | None
    closures: bool

    def execute(self, program: list[Instr], pc: int, end: int) -> None:
        """Run instructions [pc, end) of a program."""

    def operands(self, source: SourceText, items: list[Node]) -> Operands:
        """Resolve the items of a group into a queue."""

    def evaluate(self, q: Operands, n_targets: int) -> None:
        """Apply the evaluation rule to a queue."""

    def resolve_accesses(self, q: Operands) -> None:
        """Replace table accesses of a queue by the elements."""

    def echo(self, source: SourceText, first: int, last: int) -> None:
        """Write lines of a source text as they are read."""

    def call_with_numbers(self, procedure: Procedure, values: list[Any], instr: Instr, node: Node) -> list[Any] | None:
        """Call a procedure for the closures."""

    def assign_name(self, name: str, value: Any, instr: Instr | None) -> None:
        """Bind a name in the current frame."""
