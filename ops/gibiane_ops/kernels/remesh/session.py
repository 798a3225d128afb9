"""One gmsh model at a time: opened with fixed options, always closed, failures turned into kernel errors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.errors import KernelError, MeshingFailed, MissingPackage, MissingSystemLibrary

DEBIAN_PACKAGES: dict[str, str] = {
    "libGLU.so.1": "libglu1-mesa",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXrender.so.1": "libxrender1",
    "libXcursor.so.1": "libxcursor1",
    "libXfixes.so.3": "libxfixes3",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1",
}
"""Libraries that the gmsh wheel needs and does not hold, with the Debian package of each."""

OPTIONS: dict[str, float] = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.MaxNumThreads1D": 1,
    "Mesh.MaxNumThreads2D": 1,
    "Mesh.MaxNumThreads3D": 1,
    "Mesh.RandomSeed": 1,
    # Delaunay: the frontal default of gmsh leaves the inside coarse when the boundary is coarser than the sizes asked.
    "Mesh.Algorithm": 5,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.OptimizeNetgen": 1,
}
"""One thread and fixed seeds: the same input gives the same mesh, bit for bit."""

BAMG = 7
"""Code of gmsh for the plane mesher that follows a metric."""

ELEMENT_TYPES = {0: 15, 1: 1, 2: 2, 3: 4}
"""gmsh element code of the simplex of each dimension."""


def load_gmsh() -> Any:
    """Import gmsh.

    Returns
    -------
    module

    Raises
    ------
    MissingPackage
        gmsh is not installed.
    MissingSystemLibrary
        It is, but a shared library of the system that it needs is not.
    """
    try:
        import gmsh
    except ImportError as error:
        raise MissingPackage("gmsh", "pip install gmsh") from error
    except OSError as error:
        raise missing_library(str(error)) from error
    return gmsh


def missing_library(message: str) -> KernelError:
    """Name the library that a loader complains about, and the package that brings it.

    Parameters
    ----------
    message : str
        E.g. ``libGLU.so.1: cannot open shared object file: No such file or directory``.

    Returns
    -------
    KernelError
        MissingSystemLibrary, or MissingPackage when the message names no library.
    """
    found = re.search(r"lib[\w+-]+\.so[.\d]*", message)
    if found is None:
        return MissingPackage("gmsh", f"it is installed but does not load: {message}")
    library = found.group()
    return MissingSystemLibrary(library, DEBIAN_PACKAGES.get(library, f"the one that holds {library}"))


@contextmanager
def gmsh_model(options: Mapping[str, float] | None = None) -> Iterator[Any]:
    """Open an empty model and close it whatever happens.

    Parameters
    ----------
    options : dict of str to float, optional
        Added to `OPTIONS`.

    Yields
    ------
    module
        gmsh.

    Raises
    ------
    MeshingFailed
        With the words of gmsh, when a call inside the block fails.
    """
    gmsh = load_gmsh()
    # Handlers of signals and configuration files of the user would make a run depend on where it happens.
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in (OPTIONS | dict(options or {})).items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("mesh")
        yield gmsh
    except KernelError:
        raise
    except Exception as error:
        # gmsh raises bare Exception with its last message.
        if type(error) is not Exception:
            raise
        raise MeshingFailed(str(error) or gmsh.logger.getLastError()) from error
    finally:
        gmsh.finalize()


def set_size_field(gmsh: Any, points: FloatArray, cells: IntArray, sizes: FloatArray) -> None:
    """Make the sizes of the next mesh those of a field carried by a mesh.

    Parameters
    ----------
    gmsh : module
    points : (n_points, 3) float64, length
    cells : (m, 3) or (m, 4) int64
        Triangles or tetrahedra.
    sizes : (n_points,) float64, length
        Interpolated; a point outside takes the value of the nearest node.
    """
    m, n = cells.shape
    view = gmsh.view.add("size")
    data = np.hstack([points[cells].transpose(0, 2, 1).reshape(m, 3 * n), sizes[cells]])
    gmsh.view.addListData(view, {3: "ST", 4: "SS"}[n], m, data.ravel())
    _follow(gmsh, view)


def _follow(gmsh: Any, view: int) -> None:
    """Make a view the background mesh; a point outside of it takes the value of the nearest node."""
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    gmsh.model.mesh.field.setNumber(field, "UseClosest", 1)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)


def set_metric_field(gmsh: Any, points: FloatArray, cells: IntArray, metric: FloatArray) -> None:
    """Make the sizes of the next plane mesh those of a field of metrics, and choose the mesher that follows it.

    Parameters
    ----------
    gmsh : module
    points : (n_points, 3) float64, length
    cells : (m, 3) int64
    metric : (n_points, 2, 2) float64, length^-2
        Interpolated; a point outside takes the value of the nearest node.

    Raises
    ------
    MeshingFailed
        When gmsh has been built without BAMG.

    Notes
    -----
    BAMG does not give the same mesh twice, whatever the seed and the number of threads.
    """
    m = len(cells)
    if "Bamg" not in gmsh.option.getString("General.BuildOptions").split():
        raise MeshingFailed("this gmsh has no BAMG, which meshes to sizes that depend on the direction")
    gmsh.option.setNumber("Mesh.Algorithm", BAMG)
    full = np.zeros((len(metric), 3, 3))
    full[:, :2, :2] = metric
    full[:, 2, 2] = np.sqrt(np.linalg.det(metric))
    view = gmsh.view.add("metric")
    data = np.hstack([points[cells].transpose(0, 2, 1).reshape(m, 9), full[cells].reshape(m, 27)])
    gmsh.view.addListData(view, "TT", m, data.ravel())
    _follow(gmsh, view)


def set_constant_size(gmsh: Any, size: float) -> None:
    """Make the size of the next mesh the same everywhere.

    Parameters
    ----------
    gmsh : module
    size : float, length
    """
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", repr(float(size)))
    gmsh.model.mesh.field.setAsBackgroundMesh(field)


def read_nodes(gmsh: Any) -> tuple[FloatArray, IntArray]:
    """Read the nodes of the model.

    Parameters
    ----------
    gmsh : module

    Returns
    -------
    points : (n, 3) float64
        In increasing order of their tags.
    position : (largest tag + 1,) int64
        Row of each tag, -1 for a tag that does not exist.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    position = np.full(int(tags.max(initial=0)) + 1, -1, np.int64)
    position[tags[order].astype(np.int64)] = np.arange(len(tags))
    return coordinates.reshape(-1, 3)[order], position


def read_simplices(gmsh: Any, dim: int, entity: int, position: IntArray) -> IntArray:
    """Read the simplices of one entity.

    Parameters
    ----------
    gmsh : module
    dim, entity : int
    position : (k,) int64
        From `read_nodes`.

    Returns
    -------
    (m, dim + 1) int64
    """
    _, nodes = gmsh.model.mesh.getElementsByType(ELEMENT_TYPES[dim], entity)
    return np.asarray(position[nodes.astype(np.int64)].reshape(-1, dim + 1), np.int64)
