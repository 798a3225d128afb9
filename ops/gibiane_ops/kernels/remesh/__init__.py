"""Meshes of simplices made by gmsh: filling of a given boundary, and new meshes of an old domain."""

from gibiane_ops.kernels.remesh.fill import mesh_volume
from gibiane_ops.kernels.remesh.fill_plane import contours_of, mesh_surface
from gibiane_ops.kernels.remesh.filled import FilledMesh
from gibiane_ops.kernels.remesh.rebuild import Remeshed, remesh

__all__ = ["FilledMesh", "Remeshed", "contours_of", "mesh_surface", "mesh_volume", "remesh"]
