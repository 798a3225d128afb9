"""Arithmetic of fields: sums, products and functions of CHPOINT and MCHAML."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gibiane_ops.kernels.topology import group_by_nodes
from gibiane_ops.values.champs import INDETERMINE, ChamZone, ChPoint, MChaml, Part
from gibiane_ops.values.modele import ContactZone, ModelZone
from gibiane_ops.values.nodes import FloatArray, IntArray

SCAL, SCALAIRE = "SCAL", "SCALAIRE"
Field = ChPoint | MChaml
Binary = Callable[[FloatArray, FloatArray], FloatArray]
AT_POINTS = {"RIGIDITE", "STRESSES"}


class Incompatible(Exception):
    """Two fields that an operation cannot put together: code of the error, sentence, fields of the sentence."""

    def __init__(self, code: int, template: str, **fields: object) -> None:
        super().__init__(template)
        self.code = code
        self.template = template
        self.fields = fields


def mapped(field: Field, function: Callable[[FloatArray], FloatArray]) -> Field:
    """Apply a function to every value of a field."""
    if isinstance(field, ChPoint):
        parts = {name: (nodes, function(values)) for name, (nodes, values) in field.parts.items()}
        return ChPoint(field.store, parts, field.nature, field.title)
    zones = [ChamZone(z.zone, z.names, function(z.values)) for z in field.zones]
    return MChaml(zones, field.subtype, field.support, field.title)


def values_of(field: Field, names: Sequence[str] | None = None) -> FloatArray:
    """Return the values of a field, of all its components or of some, as one flat array."""
    if isinstance(field, ChPoint):
        parts = [v for name, (_, v) in field.parts.items() if names is None or name in names]
    else:
        parts = [z.component(n).ravel() for z in field.zones for n in z.names if names is None or n in names]
    return np.concatenate(parts) if parts else np.zeros(0)


def added(a: Field, b: Field, sign: float = 1.0) -> Field:
    """Return a + sign b on the union of their supports; what one of them lacks counts as zero.

    Element fields of different models meet in the elements that these share.
    """
    if isinstance(a, ChPoint) and isinstance(b, ChPoint):
        parts: dict[str, Part] = {}
        for name in dict.fromkeys([*a.names, *b.names]):
            nodes = np.union1d(_nodes(a, name), _nodes(b, name))
            parts[name] = (nodes, a.at(name, nodes) + sign * b.at(name, nodes))
        return ChPoint(a.store, parts, a.nature if a.nature == b.nature else INDETERMINE)
    if not (isinstance(a, MChaml) and isinstance(b, MChaml)):
        raise TypeError("added: two fields of one kind are wanted")
    zones = list(a.zones)
    for right in b.zones:
        zones = _with_zone(zones, right, sign, a, b)
    return MChaml(zones, a.subtype if a.subtype == b.subtype else SCALAIRE, _support(a, b))


def _with_zone(zones: list[ChamZone], right: ChamZone, sign: float, a: MChaml, b: MChaml) -> list[ChamZone]:
    """Return the zones of a, to which sign times a zone of b is added."""
    same = next((i for i, left in enumerate(zones) if left.zone is right.zone), None)
    if same is not None:
        return [*zones[:same], _sum_of_zones(zones[same], right, sign, a, b), *zones[same + 1 :]]
    rows = [_rows_in(left.zone, right.zone) for left in zones]
    home = next((i for i, found in enumerate(rows) if (found >= 0).all()), None)
    if home is not None:
        return [*zones[:home], _sum_of_zones(zones[home], right, sign, a, b, rows[home]), *zones[home + 1 :]]
    total = ChamZone(right.zone, right.names, sign * right.values)
    result = []
    for left, found in zip(zones, rows, strict=True):
        if (found < 0).all():
            result.append(left)
        else:
            # A part of the elements of the right zone: it takes the place of the left one.
            total = _sum_of_zones(total, left, 1.0, b, a, _whole_rows(right.zone, left.zone))
    return [*result, total]


def _rows_in(zone: ModelZone | ContactZone, part: ModelZone | ContactZone) -> IntArray:
    """Return where each element of a part stands in a zone, -1 for those that are not in it."""
    if not (isinstance(zone, ModelZone) and isinstance(part, ModelZone)) or zone.shape != part.shape:
        return np.full(1, -1)
    m = len(zone.cells)
    group, _ = group_by_nodes(np.concatenate([zone.cells, part.cells]))
    row = np.full(int(group.max(initial=0)) + 1, -1, np.int64)
    row[group[:m]] = np.arange(m)
    return row[group[m:]]


def _whole_rows(zone: ModelZone | ContactZone, part: ModelZone | ContactZone) -> IntArray:
    """Return where the elements of a part stand in a zone, all of them."""
    rows = _rows_in(zone, part)
    if (rows < 0).any():
        raise Incompatible(
            182,
            "the models of the two fields share {count} elements of {left} and {right}, but neither holds the other",
            count=int((rows >= 0).sum()),
            left=len(part.cells) if isinstance(part, ModelZone) else 0,
            right=len(zone.cells) if isinstance(zone, ModelZone) else 0,
        )
    return rows


def _nodes(field: ChPoint, name: str) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    part = field.parts.get(name)
    return part[0] if part is not None else np.zeros(0, np.int64)


def _sum_of_zones(
    left: ChamZone, right: ChamZone, sign: float, a: MChaml, b: MChaml, rows: IntArray | slice = slice(None)
) -> ChamZone:
    """Return left + sign right, the elements of the right zone standing in the given rows of the left one."""
    check_supports(left, right, a, b)
    names = list(dict.fromkeys([*left.names, *right.names]))
    m, q = len(left.values), max(left.values.shape[1], right.values.shape[1])
    total = np.zeros((m, q, len(names)))
    total[..., [names.index(n) for n in left.names]] += left.values
    for column, name in enumerate(right.names):
        total[rows, :, names.index(name)] += sign * right.values[..., column]
    return ChamZone(left.zone, names, total)


def check_supports(left: ChamZone, right: ChamZone, a: MChaml, b: MChaml) -> None:
    """Refuse values that stand at different points of the elements; one value per element goes with any."""
    counts = left.values.shape[1], right.values.shape[1]
    same = a.support == b.support or {a.support, b.support} <= AT_POINTS
    if 1 not in counts and (counts[0] != counts[1] or not same):
        raise Incompatible(
            182,
            "the values stand at different points of the elements ({left} and {right})",
            left=a.support,
            right=b.support,
        )


def _support(a: MChaml, b: MChaml) -> str:
    """Return where the result of an operation stands: the support with more points."""
    points = [max((z.values.shape[1] for z in field.zones), default=0) for field in (a, b)]
    return a.support if points[0] >= points[1] else b.support


def combined(a: Field, b: Field, op: Binary) -> Field:
    """Return op(a, b), a product or a quotient, where both are defined.

    A field of one component works on every component of the other; otherwise components of one name meet.
    """
    if isinstance(a, ChPoint) and isinstance(b, ChPoint):
        parts: dict[str, Part] = {}
        for left, right, name in _matched(a.names, b.names):
            nodes = np.intersect1d(_nodes(a, left), _nodes(b, right))
            parts[name] = (nodes, op(a.at(left, nodes), b.at(right, nodes)))
        return ChPoint(a.store, parts, a.nature if a.nature == b.nature else INDETERMINE)
    if not (isinstance(a, MChaml) and isinstance(b, MChaml)):
        raise TypeError("combined: two fields of one kind are wanted")
    zones = []
    for zone_a, zone_b in _meetings(a, b):
        check_supports(zone_a, zone_b, a, b)
        triples = _matched(zone_a.names, zone_b.names)
        columns = [op(zone_a.component(left), zone_b.component(right)) for left, right, _ in triples]
        zones.append(ChamZone(zone_a.zone, [name for *_, name in triples], np.stack(columns, axis=2)))
    if not zones:
        raise Incompatible(182, "the two fields have no zone in common")
    subtype = a.subtype if len(b.names) == 1 and len(a.names) > 1 else b.subtype if len(a.names) == 1 else SCALAIRE
    return MChaml(zones, subtype, _support(a, b))


def _meetings(a: MChaml, b: MChaml) -> list[tuple[ChamZone, ChamZone]]:
    """Return the values of two fields on the zones where both stand: for a zone and a part of it, on the part."""
    pairs = []
    for left in a.zones:
        same = b.zone_of(left.zone)
        if same is not None:
            pairs.append((left, same))
            continue
        for right in b.zones:
            rows = _rows_in(left.zone, right.zone)
            if (rows >= 0).all():
                pairs.append((ChamZone(right.zone, left.names, left.values[rows]), right))
            elif (rows >= 0).any():
                inside = _whole_rows(right.zone, left.zone)
                pairs.append((left, ChamZone(left.zone, right.names, right.values[inside])))
    return pairs


def _matched(left: Sequence[str], right: Sequence[str]) -> list[tuple[str, str, str]]:
    """Return the components that meet: (of a, of b, of the result)."""
    if len(right) == 1:
        return [(name, right[0], right[0] if name == SCAL and len(left) == 1 else name) for name in left]
    if len(left) == 1:
        return [(left[0], name, name) for name in right]
    common = [(name, name, name) for name in left if name in right]
    if not common:
        raise Incompatible(179, "no component in common ({left}; {right})", left=" ".join(left), right=" ".join(right))
    return common


def by_names(
    a: Field, b: Field, op: Binary, first: Sequence[str], second: Sequence[str], result: Sequence[str]
) -> Field:
    """Return the field whose component result[i] is op(a.first[i], b.second[i]); equal results names are summed."""
    total: Field | None = None
    for left, right, name in zip(first, second, result, strict=True):
        term = combined(chosen(a, [left], [name]), chosen(b, [right], [name]), op)
        total = term if total is None else added(total, term)
    if total is None:
        raise Incompatible(21, "the lists of components are empty")
    return total


def chosen(field: Field, names: Sequence[str], new: Sequence[str] | None = None, *, lenient: bool = False) -> Field:
    """Return a field with some components, renamed if `new` is given.

    Raises
    ------
    Incompatible
        When a component is absent, unless `lenient`.
    """
    renamed = dict(zip(names, new if new is not None else names, strict=True))
    for name in names:
        if name not in field.names and not lenient:
            code = 181 if isinstance(field, ChPoint) else 236
            raise Incompatible(
                code,
                "the field has no component {name}; it has {known}",
                name=name,
                known=" ".join(field.names) or "none",
            )
    if isinstance(field, ChPoint):
        parts = {renamed[n]: field.parts[n] for n in names if n in field.parts}
        # a component renamed SCAL is known by its old name in pictures
        title = names[0] if len(names) == 1 and renamed[names[0]] == SCAL != names[0] else field.title
        return ChPoint(field.store, parts, field.nature, title)
    zones = []
    for zone in field.zones:
        kept = [n for n in names if n in zone.names]
        if kept:
            columns = [zone.names.index(n) for n in kept]
            zones.append(ChamZone(zone.zone, [renamed[n] for n in kept], zone.values[:, :, columns]))
    return MChaml(zones, field.subtype, field.support)


def restricted(field: MChaml, zone: ModelZone) -> ChamZone | None:
    """Return the values of a field on a zone of another model, element by element; None if some have none."""
    own = field.zone_of(zone)
    if own is not None:
        return own
    for other in field.zones:
        found = _rows_in(other.zone, zone)
        if (found >= 0).all():
            return ChamZone(zone, other.names, other.values[found])
    return None


def joined(a: MChaml, b: MChaml) -> MChaml:
    """Return the union of two element fields: further zones, or further components on common zones."""
    zones = []
    for left in a.zones:
        right = b.zone_of(left.zone)
        if right is None:
            zones.append(left)
            continue
        shared = [n for n in left.names if n in right.names]
        if shared:
            raise Incompatible(100, "the two fields both give {names} in the same elements", names=" ".join(shared))
        zones.append(_sum_of_zones(left, right, 1.0, a, b))
    zones += [z for z in b.zones if a.zone_of(z.zone) is None]
    return MChaml(zones, a.subtype if a.subtype == b.subtype else SCALAIRE, _support(a, b))
