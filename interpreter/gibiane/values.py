"""The values of the language itself and the names of their types.

ENTIER, FLOTTANT, LOGIQUE and MOT are Python's int, float, bool and str; every other type is a subclass of
:class:`Value` that says its name. Operator packages add their own types in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar

from gibiane.diagnostics import error

if TYPE_CHECKING:
    from gibiane.nodes import Instr, Node
    from gibiane.source import SourceText

ENTIER, FLOTTANT, MOT, LOGIQUE, TEXTE = "ENTIER", "FLOTTANT", "MOT", "LOGIQUE", "TEXTE"
TABLE, OBJET, PROCEDUR, METHODE, ANNULE = "TABLE", "OBJET", "PROCEDUR", "METHODE", "ANNULE"
POINT, MAILLAGE, CHPOINT, MCHAML, MMODEL, RIGIDITE = "POINT", "MAILLAGE", "CHPOINT", "MCHAML", "MMODEL", "RIGIDITE"
LISTENTI, LISTREEL, LISTMOTS, LISTCHPO, LISTOBJE = "LISTENTI", "LISTREEL", "LISTMOTS", "LISTCHPO", "LISTOBJE"
EVOLUTIO, CHARGEME, DEFORME, VECTEUR = "EVOLUTIO", "CHARGEME", "DEFORME", "VECTEUR"
ANY = "ANY"

# Names that every session starts with; a script may give them another value.
PREDEFINED: dict[str, Any] = {"VRAI": True, "FAUX": False, "PI": math.pi, "D": "DROI", "C": "CERC"}

_PLAIN: dict[type, str] = {int: ENTIER, float: FLOTTANT, bool: LOGIQUE, str: MOT}


class Value:
    """Base of every object type of the language."""

    type_name: ClassVar[str] = OBJET

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield session.listed(" {type} de pointeur {p}", type=self.type_name, p=session.ordinal(self))

    def same(self, other: Any) -> bool:
        """Say whether EGA finds both equal (identity unless a type defines its content)."""
        return self is other

    def key(self) -> Any:
        """Return what stands for this object as a table index (identity unless a type says more)."""
        return id(self)


def type_of(value: Any) -> str:
    """Return the type name of a value, as TYPE gives it (not padded)."""
    name = _PLAIN.get(type(value))
    if name is None:
        name = value.type_name
    return name


class Annule(Value):
    """What a name holds after an error, or an absent optional argument."""

    type_name = ANNULE

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the line that LIST prints."""
        yield session.listed(" Objet annule")


NOTHING = Annule()


class Texte(Value):
    """One elementary instruction kept as text; its items replace it where it is read."""

    type_name = TEXTE

    def __init__(self, text: str, items: list[Node], source: SourceText) -> None:
        self.text = text
        self.items = items
        self.source = source

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the lines that LIST prints."""
        yield session.listed(" Texte contenant : {x}", x=self.text)


class Parameter:
    """A declared parameter of a procedure: name, wanted type (None: any), optional or not, table subtype."""

    __slots__ = ("name", "optional", "subtype", "type_name")

    def __init__(self, name: str, type_name: str | None, optional: bool, subtype: str | None) -> None:
        self.name = name
        self.type_name = type_name
        self.optional = optional
        self.subtype = subtype


class Procedure(Value):
    """A procedure: its parameters and where its body stands in its program (DEBP before, FINP at `end`)."""

    type_name = PROCEDUR

    def __init__(
        self,
        name: str,
        parameters: list[Parameter],
        program: list[Instr],
        start: int,
        end: int,
        is_method: bool = False,
    ) -> None:
        self.name = name
        self.parameters = parameters
        self.program = program
        self.start = start
        self.end = end
        self.is_method = is_method
        self.this: Objet | None = None

    def of(self, this: Objet) -> Procedure:
        """Return this method ready to be called on an object."""
        bound = Procedure(self.name, self.parameters, self.program, self.start, self.end, True)
        bound.this = this
        return bound

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the source lines."""
        first, last = self.program[self.start - 1].span(), self.program[self.end].span()
        for number in range(first.line, first.source.locate(last.end)[0] + 1):
            yield first.source.line(number).rstrip()


def index_key(index: Any) -> Any:
    """Return the dictionary key of a table index: 1, 1. and '1' differ; trailing blanks of a MOT do not count."""
    kind = type(index)
    if kind is int:
        return index
    if kind is str:
        return index.rstrip()
    if kind is float or kind is bool:
        return kind, index
    return type(index), index.key()


class Table(Value):
    """A TABLE: any value by any index, in insertion order; SOUSTYPE is an entry like any other."""

    type_name = TABLE

    def __init__(self, subtype: str | None = None) -> None:
        self.entries: dict[Any, tuple[Any, Any]] = {}
        if subtype is not None:
            self.set("SOUSTYPE", subtype)

    def get(self, index: Any) -> Any:
        """Return the value at `index`.

        Raises
        ------
        GibianeError
            535, 534 or 171 when there is none (by the type of the index).
        """
        found = self.entries.get(index_key(index))
        if found is not None:
            return found[1]
        code = {MOT: 535, FLOTTANT: 534}.get(type_of(index), 171)
        from gibiane.diagnostics import nearest

        words = [k for k, _ in self.entries.values() if isinstance(k, str)]
        close = nearest(index, words, 3) if isinstance(index, str) else None
        if close is None and isinstance(index, str):
            close = next((w for w in words if w.upper() == index.upper()), None)
        shown = f"'{index}'" if isinstance(index, str) else index if isinstance(index, int | float) else type_of(index)
        if close:
            raise error(
                code,
                "the table has no index {index}",
                index=shown,
                close=close,
                hint="did you mean '{close}'? An unquoted word is folded to upper case",
            )
        raise error(
            code,
            "the table has no index {index}",
            index=shown,
            hint="EXIS T index tells whether an index exists; LIST T shows them",
        )

    def set(self, index: Any, value: Any) -> None:
        """Set or replace the value at `index`."""
        key = index_key(index)
        self.entries[key] = (self.entries[key][0] if key in self.entries else index, value)

    def has(self, index: Any) -> bool:
        """Say whether `index` exists."""
        return index_key(index) in self.entries

    def remove(self, index: Any) -> None:
        """Remove `index` if it exists."""
        self.entries.pop(index_key(index), None)

    @property
    def subtype(self) -> str | None:
        """The SOUSTYPE, or None."""
        found = self.entries.get("SOUSTYPE")
        return found[1] if found and isinstance(found[1], str) else None

    def copy(self) -> Table:
        """Return a new table with the same entries (one level)."""
        other = Table()
        other.entries = dict(self.entries)
        return other

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the heading and one line per entry."""
        yield session.listed(" TABLE de pointeur {p}", p=session.ordinal(self))
        if brief:
            yield session.listed("  Nombre d'indices : {n}", n=len(self.entries))
            return
        yield session.listed("            Indice                          Objet")
        yield session.listed("   Type          Valeur            Type          Valeur")
        for index, value in self.entries.values():
            left = f"{type_of(index):<8}      {session.brief(index)}"
            yield f"   {left:<32}{type_of(value):<8}      {session.brief(value)}".rstrip()


class Objet(Value):
    """An OBJET: attributes that only its methods see, and its methods by name."""

    type_name = OBJET

    def __init__(self, class_name: str) -> None:
        self.class_name = class_name
        self.attributes = Table()
        self.methods: dict[str, Procedure] = {}

    def listing(self, session: Any, brief: bool = False, width: int | None = None) -> Iterator[str]:
        """Yield the class and the methods."""
        yield session.listed(" OBJET de pointeur {p} de classe {name}", p=session.ordinal(self), name=self.class_name)
        yield session.listed(" Methodes : {names}", names=" ".join(sorted(self.methods)))
