"""Simple solids meshed through gmsh, and files that it reads."""

import math

import numpy as np
import pytest

from gibiane_ops.kernels import geometry, topology
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, MeshingFailed
from gibiane_ops.kernels.remesh.session import load_gmsh
from gibiane_ops.kernels.remesh.solids import Solid, mesh_file, mesh_solid

try:
    load_gmsh()
except Exception as missing:  # a system library that gmsh needs may be absent: everything else must still be tested
    pytest.skip(str(missing), allow_module_level=True)

ORIGIN, X = np.zeros(3), np.array([1.0, 0, 0])


def volume(solid):
    return geometry.measures(shape("TET4"), solid.points[solid.cells])


def test_box_less_a_cylinder():
    box = Solid("PAVE", (ORIGIN, np.array([1.0, 1, 1])))
    hole = Solid("CYLI", (np.array([0.5, 0.5, -1]), np.array([0.5, 0.5, 2])), 0.25, "MOINS")
    made = mesh_solid([box, hole], 0.12, 3)
    assert volume(made).min() > 0
    # The chords of the hole leave a little more than the exact volume.
    exact = 1 - math.pi / 16
    assert exact < volume(made).sum() < exact + 0.02
    assert len(made.faces) == 7
    around = topology.boundary([("TET4", made.cells)])["TRI3"].nodes
    assert sum(map(len, made.faces)) == len(around)
    assert {tuple(f) for face in made.faces for f in face.tolist()} == {tuple(f) for f in around.tolist()}


def test_half_a_ball_on_the_side_asked():
    side = np.array([1.0, -2.0, 0.5])
    made = mesh_solid([Solid("DEMI", (X, side), 2.0)], 0.5, 3)
    assert ((made.points - X) @ side).min() > -1e-9
    assert volume(made).sum() == pytest.approx(16 * math.pi / 3, rel=0.06)


def test_plane_figures_turn_counterclockwise():
    made = mesh_solid([Solid("SPHE", (ORIGIN,), 1.0), Solid("DEMI", (ORIGIN, -X), 1.0, "MOINS")], 0.2, 2)
    area = geometry.measures(shape("TRI3"), made.points[made.cells][:, :, :2])
    assert area.min() > 0
    assert area.sum() == pytest.approx(math.pi / 2, rel=0.02)
    assert made.points[:, 0].min() > -1e-9


def test_what_cannot_be_meshed():
    box = Solid("PAVE", (ORIGIN, np.array([1.0, 1, 1])))
    for bad in (Solid("PAVE", (ORIGIN, X)), Solid("SPHE", (ORIGIN,), 0.0), Solid("CYLI", (ORIGIN, ORIGIN), 1.0)):
        with pytest.raises(BadValue):
            mesh_solid([bad], 0.5, 3)
    with pytest.raises(MeshingFailed, match="nothing is left"):
        mesh_solid([box, Solid("SPHE", (ORIGIN,), 9.0, "MOINS")], 0.5, 3)


def test_geometry_file_with_named_groups(tmp_path):
    path = tmp_path / "square.geo"
    path.write_text(
        "Point(1) = {0, 0, 0}; Point(2) = {2, 0, 0}; Point(3) = {2, 1, 0}; Point(4) = {0, 1, 0};\n"
        "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};\n"
        "Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};\n"
        'Physical Curve("LOW") = {1}; Physical Surface("ALL") = {1};\n'
    )
    made = mesh_file(path, 0.25, 2)
    assert geometry.measures(shape("TRI3"), made.points[made.cells][:, :, :2]).sum() == pytest.approx(2)
    assert len(made.faces) == 4
    assert set(made.named) == {"LOW", "ALL"}
    assert len(made.named["ALL"]) == len(made.cells)
    low = made.points[made.named["LOW"]]
    assert (low[:, :, 1] == 0).all()
    assert np.diff(low[:, :, 0]).sum() == pytest.approx(2)  # with the solid on its left
    path.write_text("Point(1) = ;")
    with pytest.raises(MeshingFailed):
        mesh_file(path, 0.25, 2)
