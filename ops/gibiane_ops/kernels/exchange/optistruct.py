"""Mesh files of OptiStruct as HyperMesh writes them (.fem): Nastran's cards, with components and sets in comments."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from gibiane_ops.kernels.elements.table import BY_MESHIO
from gibiane_ops.kernels.errors import UnreadableFile
from gibiane_ops.kernels.exchange.meshfile import MeshFile

_PRISM = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11)
_CUBE = (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)
# Cards by number of nodes: the type of meshio, and the places of its nodes in the card.
CARDS: dict[str, dict[int, tuple[str, tuple[int, ...]]]] = {
    "CROD": {2: ("line", (0, 1))},
    "CTRIA3": {3: ("triangle", (0, 1, 2))},
    "CTRIA6": {6: ("triangle6", tuple(range(6)))},
    "CQUAD4": {4: ("quad", (0, 1, 2, 3))},
    "CQUAD8": {8: ("quad8", tuple(range(8)))},
    "CTETRA": {4: ("tetra", (0, 1, 2, 3)), 10: ("tetra10", tuple(range(10)))},
    "CPYRA": {5: ("pyramid", tuple(range(5))), 13: ("pyramid13", tuple(range(13)))},
    "CPENTA": {6: ("wedge", tuple(range(6))), 15: ("wedge15", _PRISM)},
    "CHEXA": {8: ("hexahedron", tuple(range(8))), 20: ("hexahedron20", _CUBE)},
}
NODES = {name: max(counts) for name, counts in CARDS.items()}
ELEMENT_CARDS = re.compile(r"C(BAR|BEAM|BUSH|ROD|TUBE|GAP|ELAS|TRI|QUAD|SHEAR|TETRA|PYRA|PENTA|HEX|WELD|GASK|IF)")
NAMED = re.compile(r'\$HMNAME\s+COMPS?\s+(\d+)\s*"([^"]*)"(?:\s+(\d+))?')
SET_NAME = re.compile(r'\$HMSET\s+(\d+)\s+(\d+)\s+"([^"]*)"')
FLOAT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def read_fem(path: str, text: str) -> MeshFile:
    """Read the text of a file of OptiStruct.

    Parameters
    ----------
    path : str
    text : str

    Returns
    -------
    MeshFile
        Groups are the components ($HMNAME COMP, of the elements that $HMMOVE lists, or else of its property) and the
        sets of elements; groups of nodes the sets of nodes. Coordinate systems of nodes are not applied.

    Raises
    ------
    UnreadableFile
        When it is cut (no ENDDATA) or holds something else.
    """
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("BEGIN BULK")), None)
    end = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("ENDDATA")), None)
    if start is None:
        raise UnreadableFile(path, "it is no OptiStruct file (no BEGIN BULK)")
    if end is None:
        raise UnreadableFile(path, "it is cut (no ENDDATA)")
    body = lines[start + 1 : end]
    labels: list[int] = []
    points: list[list[float]] = []
    cells: dict[str, list[list[int]]] = {}
    place: dict[int, tuple[str, int]] = {}
    owners: dict[int, list[int]] = {}
    sets: list[tuple[int, str, list[int]]] = []
    skipped: set[str] = set()
    try:
        for card in _cards(body):
            name = card[0].upper()
            if name == "GRID":
                if card[2].strip("0") or (len(card) > 6 and card[6].strip("0")):
                    raise UnreadableFile(path, f"node {card[1]} stands in a coordinate system, which is not read")
                labels.append(int(card[1]))
                points.append([_number(card[k]) if k < len(card) else 0.0 for k in (3, 4, 5)])
            elif name in CARDS:
                nodes = [int(field) for field in card[3 : 3 + NODES[name]] if field.strip().isdigit()]
                if len(nodes) not in CARDS[name]:
                    raise ValueError(card[1])
                kind, order = CARDS[name][len(nodes)]
                if kind not in BY_MESHIO:
                    skipped.add(name)
                    continue
                rows = cells.setdefault(BY_MESHIO[kind].name, [])
                place[int(card[1])] = BY_MESHIO[kind].name, len(rows)
                owners.setdefault(int(card[2] or card[1]), []).append(int(card[1]))
                rows.append([nodes[k] for k in order])
            elif name == "SET" and len(card) > 2 and card[2].upper() in ("GRID", "ELEM"):
                sets.append((int(card[1]), card[2].upper(), _members(card[4:])))
            elif ELEMENT_CARDS.match(name):
                skipped.add(name)
    except (ValueError, IndexError) as failure:
        raise UnreadableFile(path, "a card in it is cut or damaged") from failure
    index = {label: i for i, label in enumerate(labels)}
    try:
        blocks = [(name, np.array([[index[n] for n in row] for row in rows])) for name, rows in cells.items()]
        nodes_of_sets = {number: [index[n] for n in named] for number, kind, named in sets if kind == "GRID"}
    except KeyError as failure:
        raise UnreadableFile(path, f"node {failure.args[0]} is used and not defined") from failure
    found = MeshFile(np.array(points, np.float64).reshape(-1, 3), blocks, skipped=tuple(sorted(skipped)))
    position = {name: i for i, (name, _) in enumerate(blocks)}

    def group(name: str, members: list[int]) -> None:
        rows: dict[int, list[int]] = {}
        for label in members:
            if label in place:
                of, row = place[label]
                rows.setdefault(position[of], []).append(row)
        if rows:
            found.groups[name] = [(i, np.array(r, np.int64)) for i, r in sorted(rows.items())]

    moved = _moved(body)
    listed = {label for members in moved.values() for label in members}
    for number, title, of in (match.groups() for match in map(NAMED.match, body) if match):
        rest = [label for label in owners.get(int(of or number), []) if label not in listed]
        group(title.strip(), [*moved.get(int(number), []), *rest])
    titles = {int(m[1]): m[3].strip() for m in map(SET_NAME.match, body) if m}
    for number, kind, members in sets:
        title = titles.get(number, f"SET{number}")
        if kind == "ELEM":
            group(title, members)
        elif members:
            found.node_groups[title] = np.array(nodes_of_sets[number], np.int64)
    return found


def _cards(lines: list[str]) -> Iterator[list[str]]:
    """Yield the fields of each card, continuations joined; fields of 8 or 16 columns, or between commas."""
    card: list[str] = []
    for line in lines:
        if not line.strip() or line.startswith("$"):
            continue
        text = line.split("$")[0].rstrip().expandtabs(8)
        if "," in text:
            fields = [field.strip() for field in text.split(",")][:9]
            head, fields = fields[0], fields[1:]
            fields += [""] * (8 - len(fields))
        else:
            head, rest = text[:8].strip(), text[8:72]
            width = 16 if "*" in head else 8
            fields = [rest[k : k + width].strip() for k in range(0, 64, width)]
        if not head or head[0] in "+*":
            card += fields
            continue
        if card:
            yield card
        card = [head.rstrip("*"), *fields]
    if card:
        yield card


def _number(field: str) -> float:
    """Read a real number of Nastran, whose exponent may lack its letter (1.5-3)."""
    text = field.strip().upper().replace("D", "E")
    return float(text if "E" in text else FLOAT.sub(r"E\1", text)) if text else 0.0


def _members(fields: list[str]) -> list[int]:
    """Read numbers, with ranges a THRU b."""
    words = [field.upper() for field in fields if field]
    found: list[int] = []
    for k, word in enumerate(words):
        if word == "THRU":
            found += range(found.pop(), int(words[k + 1]))
        else:
            found.append(int(word))
    return found


def _moved(lines: list[str]) -> dict[int, list[int]]:
    """Return the elements that comments put into each component: `$HMMOVE number`, then lines `$ 1 2 5 THRU 9`."""
    found: dict[int, list[int]] = {}
    current: list[int] | None = None
    for line in lines:
        if line.startswith("$HMMOVE"):
            current = found.setdefault(int(line.split()[1]), [])
        elif current is not None and re.fullmatch(r"\$[\s\dTHRU]*\d[\s\dTHRU]*", line):
            rest = line[1:].expandtabs(8)
            current += _members(re.findall(r"THRU|\d+", _columns(rest)))
        else:
            current = None
    return found


def _columns(text: str) -> str:
    """Part fields of 8 columns that touch each other."""
    body = text[7:]
    return " ".join([text[:7], *(body[k : k + 8] for k in range(0, len(body), 8))])
