"""REMAILLER in place: elements divided and put together ('LOCA'), raised to the second degree (a field of marks)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gibiane.registry import Context
from gibiane.values import Table
from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.adapt.contact_degrees import paired_degrees
from gibiane_ops.kernels.adapt.hierarchy import Hierarchy, LocalMesh, adapted, faces_in_order, founded
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.quadratic import QUADRATIC
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.hanging import hanging_nodes
from gibiane_ops.kernels.mesh import unions
from gibiane_ops.kernels.mesh.hosts import find_hosts
from gibiane_ops.mesh.building import dimension, explained, join, new_mesh, nodes_of
from gibiane_ops.mesh.degree import LINEAR, linear_mesh, quadratic_mesh
from gibiane_ops.mesh.groups import Groups
from gibiane_ops.mesh.wanted import refuse_too_many, sizes_at
from gibiane_ops.values.arbre import Arbre
from gibiane_ops.values.champs import ChPoint, MChaml
from gibiane_ops.values.maillage import Block, Maillage, Point
from gibiane_ops.values.modele import ModelZone

SHAPES: dict[int, dict[str, dict[int, str]]] = {
    2: {"TRI3": {1: "POI1", 2: "SEG2", 3: "TRI3"}, "QUA4": {1: "POI1", 2: "SEG2", 4: "QUA4"}},
    3: {
        "TET4": {1: "POI1", 2: "SEG2", 3: "TRI3", 4: "TET4"},
        "CUB8": {1: "POI1", 2: "SEG2", 4: "QUA4", 8: "CUB8"},
    },
}


def divide(
    ctx: Context, g: Maillage, size: float | ChPoint | None, table: Table, marks: MChaml | None
) -> tuple[Maillage, Table]:
    """Divide elements that are too large, put back together those that are too small, raise the degree of marked ones.

    Parameters
    ----------
    ctx : Context
    g : Maillage
        TRI3, QUA4, TET4 or CUB8, also of second degree.
    size : float or ChPoint, optional
        Sizes wanted; if absent nothing is divided.
    table : Table
        Groups, and ARBRE if the mesh has been divided before.
    marks : MChaml, optional
        Elements above 0.5 become quadratic, the others linear.

    Returns
    -------
    mesh : Maillage
    table : Table
        The groups, and under ARBRE how the mesh is divided.
    """
    dim = dimension(ctx)
    name, cells, degree = _elements(ctx, g, dim)
    if marks is not None:
        degree = 1 + _marked(cells, marks)
    old = Groups(ctx, table, np.unique(cells), SHAPES[dim][name])
    state, ids, cells, degree = _history(ctx, name, cells, degree, table, old)
    unknown = [old.keys[key] for key in old.cells if key not in state.groups]
    if unknown:
        ctx.fail(
            21,
            "the group {index} was not in the table when the mesh was first divided",
            at="grou",
            index=unknown[0],
            hint="put it in the table before the first REMAILLER 'LOCA', or take ARBRE out to begin again from here",
        )
    before = state.mesh()
    store = nodes_of(ctx)
    if size is None:
        mesh, new = before, ids
    else:
        sizes = np.broadcast_to(np.asarray(sizes_at(ctx, size, ids), np.float64), len(ids))
        refuse_too_many(ctx, before.points, [(name, before.cells)], sizes)
        with explained(ctx, "g"):
            state, _ = adapted(state, sizes)
            mesh = state.mesh()
        new = store.add(mesh.points, store.density[ids][_nearest(before.points, mesh.points)])
        degree = _inherited(name, before, mesh, degree)
    degree = _raisable(name, mesh, degree)
    made = new[mesh.cells]
    result = _of_degrees(ctx, name, made, degree)
    quadratic = _quadratic_parts(name, made[degree == 2])
    renewed = old.renewed({key: mesh.groups[key] for key in old.cells}, new, quadratic)
    renewed.set("ARBRE", Arbre(state, new, made))
    return result, renewed


def move_nodes(ctx: Context, g: Maillage, move: ChPoint, table: Table) -> tuple[Maillage, Table]:
    """Make the same mesh and groups on new nodes, moved by a field; nodes that the field leaves out stay.

    Raises
    ------
    GibianeError
        195 when an element turns over or becomes flat.
    """
    dim = dimension(ctx)
    store = nodes_of(ctx)
    nodes = g.nodes
    if not set(move.names) & {"UX", "UY", "UZ"}:
        ctx.fail(181, "a field of moves has components UX UY UZ, not {names}", at="move", names=" ".join(move.names))
    coords = store.coords[nodes].copy()
    for axis, name in enumerate(("UX", "UY", "UZ")[:dim]):
        if name in move.names:
            at, values = move.parts[name]
            inside = np.isin(at, nodes)
            coords[np.searchsorted(nodes, at[inside]), axis] += values[inside]
    with explained(ctx, "move"):
        for block in g.blocks:
            of = shape(block.shape)
            geometry.check_cells(of, coords[np.searchsorted(nodes, block.cells)][..., :dim])
    new = store.add(coords, store.density[nodes])

    def renamed(mesh: Maillage) -> Maillage:
        for block in mesh.blocks:
            if not np.isin(block.cells, nodes).all():
                ctx.fail(21, "a group is not a part of the mesh: some of its nodes are elsewhere", at="grou")
        blocks = [Block(b.shape, new[np.searchsorted(nodes, b.cells)], b.colours) for b in mesh.blocks]
        return Maillage(store, blocks)

    return renamed(g), _renamed_table(table, renamed, nodes, new)


def _renamed_table(
    table: Table,
    renamed: Callable[[Maillage], Maillage],
    nodes: IntArray,
    new: IntArray,
    made: dict[int, Any] | None = None,
) -> Table:
    """Copy a table of groups, its meshes and points on new nodes; one object that stands twice stays one."""
    known: dict[int, Any] = {} if made is None else made
    result = Table()
    for index, value in table.entries.values():
        if index == "ARBRE":
            continue
        if id(value) not in known:
            if isinstance(value, Table):
                known[id(value)] = _renamed_table(value, renamed, nodes, new, known)
            elif isinstance(value, Maillage):
                known[id(value)] = renamed(value)
            elif isinstance(value, Point):
                known[id(value)] = Point(value.store, int(new[np.searchsorted(nodes, value.node)]))
            else:
                known[id(value)] = value
        result.set(index, known[id(value)])
    return result


def _elements(ctx: Context, g: Maillage, dim: int) -> tuple[str, IntArray, IntArray]:
    """Return the linear kind of the elements, their corners and their degrees."""
    linear_mesh(ctx, g)  # remembers the mid-nodes
    kinds = {LINEAR.get(block.shape, block.shape) for block in g.blocks}
    if len(kinds) != 1 or not kinds <= set(SHAPES.get(dim, {})):
        ctx.fail(
            16,
            "elements of one kind are wanted, among {wanted}: this mesh holds {shapes}",
            at="g",
            wanted=" ".join(SHAPES.get(dim, {})) or "those of OPTI DIME 2 or 3",
            shapes=" ".join(g.shapes) or "no element",
            hint="CHAN cuts elements into simplices",
        )
    (name,) = kinds
    n = shape(name).n_nodes
    cells = np.concatenate([block.cells[:, :n] for block in g.blocks])
    return name, cells, np.concatenate([np.full(len(block.cells), shape(block.shape).degree) for block in g.blocks])


def _marked(cells: IntArray, marks: MChaml) -> IntArray:
    """Return 1 for the elements that a field marks, 0 elsewhere."""
    result = np.zeros(len(cells), np.int64)
    for part in marks.zones:
        if not isinstance(part.zone, ModelZone):
            continue
        value = part.component(part.names[0]).mean(axis=1)
        chosen = part.zone.cells[value > 0.5][:, : cells.shape[1]]
        result[unions.is_in(cells, chosen)] = 1
    return result


def _history(
    ctx: Context, name: str, cells: IntArray, degree: IntArray, table: Table, groups: Groups
) -> tuple[Hierarchy, IntArray, IntArray, IntArray]:
    """Return the divisions of a mesh, or begin them; its nodes, elements and degrees in the order of these."""
    tree = table.get("ARBRE") if table.has("ARBRE") else None
    if isinstance(tree, Arbre) and len(tree.cells) == len(cells) and unions.is_in(tree.cells, cells).all():
        row = topology.group_by_nodes(np.concatenate([tree.cells, cells]))[0]
        place = np.empty(len(cells), np.int64)
        place[row[: len(cells)]] = np.arange(len(cells))
        ordered = np.empty(len(cells), np.int64)
        ordered[place[row[len(cells) :]]] = degree
        return tree.state, tree.ids, tree.cells, ordered
    nodes = groups.nodes
    with explained(ctx, "grou"):
        points = nodes_of(ctx).coords[nodes][:, : dimension(ctx)]
        state = founded(name, points, np.searchsorted(nodes, cells), groups.cells, groups.pairs)
    first = state.mesh()
    ids = np.empty(len(first.points), np.int64)
    ids[first.cells.ravel()] = cells.ravel()
    return state, ids, cells, degree


def _nearest(old: FloatArray, new: FloatArray) -> IntArray:
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(old).query(new)[1], np.int64)


def _inherited(name: str, before: LocalMesh, mesh: LocalMesh, degree: IntArray) -> IntArray:
    """Give new elements the degree of the old one at their centre."""
    if (degree == 1).all():
        return np.ones(len(mesh.cells), np.int64)
    centres = mesh.points[mesh.cells].mean(axis=1)
    hosts = find_hosts(centres, before.points, [(name, before.cells)], nearest=True)
    return degree[hosts.cell]


def _raisable(name: str, mesh: LocalMesh, degree: IntArray) -> IntArray:
    """Keep linear the elements that hanging nodes touch, and give the two sides of a contact one degree."""
    if (degree == 1).all():
        return degree
    linear = np.zeros(len(degree), bool)
    nodes, masters = hanging_nodes(mesh.points, [(name, mesh.cells)])
    if len(nodes):
        edges = mesh.cells[:, np.array([edge[:2] for edge in shape(name).edges])]
        halved = unions.is_in(edges.reshape(-1, 2), masters[masters[:, 2] < 0, :2]).reshape(len(edges), -1)
        linear |= halved.any(axis=1) | np.isin(mesh.cells, nodes).any(axis=1)
    return paired_degrees(name, mesh.cells, mesh.pairs, np.where(linear, 1, degree), ~linear)


def _of_degrees(ctx: Context, name: str, cells: IntArray, degree: IntArray) -> Maillage:
    """Make a mesh whose elements have one degree each."""
    parts = []
    if (degree == 1).any():
        parts.append(new_mesh(ctx, [(name, cells[degree == 1])]))
    if (degree == 2).any():
        parts.append(quadratic_mesh(ctx, new_mesh(ctx, [(name, cells[degree == 2])])))
    return join(parts)


def _quadratic_parts(name: str, cells: IntArray) -> dict[int, IntArray]:
    """Return the parts that quadratic elements have, by number of corners: themselves, their facets, their edges."""
    of = shape(name)
    if name not in QUADRATIC or not len(cells):
        return {}
    faces = faces_in_order(name, cells)
    edges = cells[:, np.array([edge[:2] for edge in of.edges])].reshape(-1, 2)
    return {2: edges, faces.shape[2]: faces.reshape(-1, faces.shape[2]), of.n_nodes: cells}
