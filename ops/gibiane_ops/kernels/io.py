"""Meshes and fields into files that other programs read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

EXTENSIONS = (".vtu", ".vtk")


def write_mesh(
    path: Path | str,
    points: FloatArray,
    blocks: Sequence[tuple[str, IntArray]],
    point_data: Mapping[str, FloatArray] | None = None,
    cell_data: Mapping[str, Sequence[FloatArray]] | None = None,
) -> None:
    """Write a mesh and fields for ParaView and other readers of VTK files.

    Parameters
    ----------
    path : Path or str
        Extension .vtu (compressed) or .vtk (binary); missing folders are made.
    points : (n_points, 1 to 3) float64, length
        Missing coordinates are written as zero.
    blocks : sequence of (str, (n_cells, n_nodes) int64)
        Name of the shape and cells, in the order of nodes of the shape.
    point_data : mapping of str to (n_points,) or (n_points, dim) float64, optional
        Scalars and vectors; the missing coordinates of vectors are written as zero.
    cell_data : mapping of str to one (n_cells,) or (n_cells, dim) float64 for each block, optional

    Raises
    ------
    BadValue
        When the extension or a shape is unknown, a node number lies outside the points, or a field has not the size of
        its support or is neither a scalar nor a vector.

    Notes
    -----
    A tensor has to be given a component at a time: VTK orders the six numbers xx yy zz xy yz xz, another order than
    here, and readers would name them wrongly.
    """
    path = Path(path)
    if path.suffix.lower() not in EXTENSIONS:
        raise BadValue("name of a mesh file", path.name, f"an extension {' or '.join(EXTENSIONS)}")
    n_points = len(points)
    cells = []
    for name, block in blocks:
        if block.size and not 0 <= int(block.min()) <= int(block.max()) < n_points:
            wrong = int(block.max()) if block.max() >= n_points else int(block.min())
            raise BadValue(f"node of a {name}", wrong, f"0 <= node < {n_points}")
        cells.append((shape(name).meshio_name, block))
    at_points = {name: _columns(name, values, n_points) for name, values in (point_data or {}).items()}
    in_cells = {}
    for name, parts in (cell_data or {}).items():
        if len(parts) != len(blocks):
            raise BadValue(f"field {name}", f"{len(parts)} blocks", f"one for each of the {len(blocks)} blocks")
        in_cells[name] = [_columns(name, part, len(block)) for part, (_, block) in zip(parts, blocks, strict=True)]

    import meshio

    mesh = meshio.Mesh(_padded(np.asarray(points, np.float64)), cells, point_data=at_points, cell_data=in_cells)
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.write(path, file_format=path.suffix[1:].lower())


def _columns(name: str, values: FloatArray, n: int) -> FloatArray:
    """Check the size of a field; give vectors three columns."""
    values = np.asarray(values, np.float64)
    if len(values) != n:
        raise BadValue(f"field {name}", f"{len(values)} values", f"{n} values")
    if values.ndim == 1:
        return values
    if values.ndim != 2 or values.shape[1] > 3:
        raise BadValue(f"field {name}", f"values of shape {values.shape[1:]}", "a scalar or a vector")
    return values[:, 0] if values.shape[1] == 1 else _padded(values)


def _padded(values: FloatArray) -> FloatArray:
    """Add columns of zeros up to three."""
    return np.column_stack([values, np.zeros((len(values), 3 - values.shape[1]))])
