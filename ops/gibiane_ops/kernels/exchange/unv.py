"""Universal files (I-DEAS, .unv): nodes (2411), elements (2412) and groups (2467 and its predecessors)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gibiane_ops.kernels.errors import UnreadableFile
from gibiane_ops.kernels.exchange.meshfile import MeshFile

# FE descriptor of the universal format: shape, and the local node of the shape at each place of the record.
DESCRIPTORS = {
    11: ("SEG2", (0, 1)),
    21: ("SEG2", (0, 1)),
    22: ("SEG3", (0, 2, 1)),
    24: ("SEG3", (0, 2, 1)),
    41: ("TRI3", (0, 1, 2)),
    42: ("TRI6", (0, 3, 1, 4, 2, 5)),
    44: ("QUA4", (0, 1, 2, 3)),
    45: ("QUA8", (0, 4, 1, 5, 2, 6, 3, 7)),
    51: ("TRI3", (0, 1, 2)),
    54: ("QUA4", (0, 1, 2, 3)),
    91: ("TRI3", (0, 1, 2)),
    92: ("TRI6", (0, 3, 1, 4, 2, 5)),
    94: ("QUA4", (0, 1, 2, 3)),
    95: ("QUA8", (0, 4, 1, 5, 2, 6, 3, 7)),
    111: ("TET4", (0, 1, 2, 3)),
    112: ("PRI6", (0, 1, 2, 3, 4, 5)),
    113: ("PR15", (0, 6, 1, 7, 2, 8, 12, 13, 14, 3, 9, 4, 10, 5, 11)),
    115: ("CUB8", (0, 1, 2, 3, 4, 5, 6, 7)),
    116: ("CU20", (0, 8, 1, 9, 2, 10, 3, 11, 16, 17, 18, 19, 4, 12, 5, 13, 6, 14, 7, 15)),
    118: ("TE10", (0, 4, 1, 5, 2, 6, 7, 8, 9, 3)),
}
BEAMS = (11, 21, 22, 24)
WRITTEN = {"SEG2": 11, "SEG3": 22, "TRI3": 91, "TRI6": 92, "QUA4": 94, "QUA8": 95, "TET4": 111, "TE10": 118,
           "PRI6": 112, "PR15": 113, "CUB8": 115, "CU20": 116}  # fmt: skip
NODES, ELEMENTS, GROUPS = ("2411", "781"), ("2412", "780"), ("2467", "2477", "2452", "2435", "2430", "2429")
NODE, ELEMENT = 7, 8
PER_LINE = 8


def read_unv(path: str, text: str) -> MeshFile:
    """Read the text of a universal file.

    Raises
    ------
    UnreadableFile
        When it is cut or holds something else.
    """
    labels: list[int] = []
    points: list[list[float]] = []
    cells: dict[str, list[list[int]]] = {}
    place: dict[int, tuple[str, int]] = {}
    groups: list[tuple[str, list[tuple[int, int]]]] = []
    skipped: set[str] = set()
    try:
        for dataset, lines in _datasets(path, text):
            if dataset in NODES:
                for head, record in zip(lines[0::2], lines[1::2], strict=True):
                    labels.append(int(head.split()[0]))
                    points.append([float(x.replace("D", "E").replace("d", "e")) for x in record.split()[:3]])
            elif dataset in ELEMENTS:
                _elements(lines, cells, place, skipped)
            elif dataset in GROUPS:
                groups.extend(_groups(lines))
    except (ValueError, IndexError) as failure:
        raise UnreadableFile(path, "a record in it is cut or damaged") from failure
    index = {label: i for i, label in enumerate(labels)}
    try:
        blocks = [(name, np.array([[index[n] for n in row] for row in rows])) for name, rows in cells.items()]
        found = MeshFile(np.array(points, np.float64).reshape(-1, 3), blocks, skipped=tuple(sorted(skipped)))
        position = {name: i for i, (name, _) in enumerate(blocks)}
        for name, members in groups:
            nodes = [index[label] for kind, label in members if kind == NODE]
            rows: dict[int, list[int]] = {}
            for kind, label in members:
                if kind == ELEMENT and label in place:
                    of, row = place[label]
                    rows.setdefault(position[of], []).append(row)
            if nodes:
                found.node_groups[name] = np.array(nodes, np.int64)
            if rows:
                found.groups[name] = [(i, np.array(r, np.int64)) for i, r in sorted(rows.items())]
    except KeyError as failure:
        raise UnreadableFile(path, f"node {failure.args[0]} is used and not defined") from failure
    return found


def _datasets(path: str, text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the number and the lines of each data set, which stand between lines with -1."""
    lines = text.splitlines()
    marks = [i for i, line in enumerate(lines) if line.strip() == "-1"]
    if not marks or len(marks) % 2:
        raise UnreadableFile(path, "its last data set is not closed" if marks else "it is no universal file")
    for first, last in zip(marks[0::2], marks[1::2], strict=True):
        if last - first > 1:
            yield lines[first + 1].strip(), lines[first + 2 : last]


def _elements(
    lines: list[str], cells: dict[str, list[list[int]]], place: dict[int, tuple[str, int]], skipped: set[str]
) -> None:
    i = 0
    while i < len(lines):
        head = [int(x) for x in lines[i].split()]
        label, descriptor, count = head[0], head[1], head[-1]
        # Beams have a record of orientation before their nodes.
        i += 2 if descriptor in BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += [int(x) for x in lines[i].split()]
            i += 1
        if descriptor not in DESCRIPTORS:
            skipped.add(f"element {descriptor}")
            continue
        name, order = DESCRIPTORS[descriptor]
        if len(nodes) != len(order):
            raise ValueError(label)
        rows = cells.setdefault(name, [])
        place[label] = name, len(rows)
        rows.append([node for _, node in sorted(zip(order, nodes, strict=True))])


def _groups(lines: list[str]) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    i = 0
    while i < len(lines):
        count = int(lines[i].split()[-1])
        name = lines[i + 1].strip()
        members: list[tuple[int, int]] = []
        i += 2
        while len(members) < count:
            numbers = [int(x) for x in lines[i].split()]
            members += [(numbers[j], numbers[j + 1]) for j in range(0, len(numbers) - 3, 4)]
            i += 1
        yield name, members


def write_unv(mesh: MeshFile) -> str:
    """Return the text of a universal file.

    Raises
    ------
    KeyError
        With the name of a shape that the format has not.
    """
    lines = ["    -1", "  2411"]
    for i, point in enumerate(mesh.points, 1):
        lines += [f"{i:10d}{1:10d}{1:10d}{11:10d}", "".join(f"{x:25.16E}" for x in point).replace("E", "D")]
    lines += ["    -1", "    -1", "  2412"]
    first = 1
    starts = []
    for name, cells in mesh.blocks:
        descriptor = WRITTEN[name]
        order = DESCRIPTORS[descriptor][1]
        starts.append(first)
        for i, row in enumerate((cells[:, order] + 1).tolist(), first):
            lines.append(f"{i:10d}{descriptor:10d}{1:10d}{1:10d}{7:10d}{len(row):10d}")
            if descriptor in BEAMS:
                lines.append(f"{0:10d}{1:10d}{1:10d}")
            lines += ["".join(f"{n:10d}" for n in row[j : j + PER_LINE]) for j in range(0, len(row), PER_LINE)]
        first += len(cells)
    lines.append("    -1")
    members = {
        name: [(ELEMENT, starts[i] + r) for i, rows in parts for r in rows] for name, parts in mesh.groups.items()
    }
    for name, nodes in mesh.node_groups.items():
        members.setdefault(name, []).extend((NODE, int(n) + 1) for n in nodes)
    if members:
        lines += ["    -1", "  2467"]
        for number, (name, entries) in enumerate(members.items(), 1):
            lines += [f"{number:10d}" + f"{0:10d}" * 6 + f"{len(entries):10d}", name]
            pieces = [f"{kind:10d}{label:10d}{0:10d}{0:10d}" for kind, label in entries]
            lines += ["".join(pieces[j : j + 2]) for j in range(0, len(pieces), 2)]
        lines.append("    -1")
    return "\n".join(lines) + "\n"
