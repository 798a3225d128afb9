import meshio
import numpy as np
import pytest

from gibiane_ops.kernels.errors import BadValue
from gibiane_ops.kernels.io import write_mesh

POINTS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [2, 0, 0.5]], float
)
BLOCKS = [("CUB8", np.arange(8)[None]), ("TET4", np.array([[1, 2, 5, 8], [2, 6, 5, 8]]))]


@pytest.mark.parametrize("extension", ["vtu", "vtk"])
def test_a_mesh_with_fields_comes_back(tmp_path, extension):
    path = tmp_path / "new" / f"mesh.{extension}"
    displacement = np.random.default_rng(0).normal(size=(9, 3))
    write_mesh(
        path,
        POINTS,
        BLOCKS,
        point_data={"DEPL": displacement, "TEMP": np.arange(9.0)},
        cell_data={"ERR": [np.array([0.25]), np.array([1.5, 2.5])]},
    )
    back = meshio.read(path)
    np.testing.assert_array_equal(back.points, POINTS)
    assert [block.type for block in back.cells] == ["hexahedron", "tetra"]
    for block, (_, cells) in zip(back.cells, BLOCKS, strict=True):
        np.testing.assert_array_equal(block.data, cells)
    np.testing.assert_array_equal(back.point_data["DEPL"], displacement)
    np.testing.assert_array_equal(back.point_data["TEMP"].ravel(), np.arange(9.0))
    np.testing.assert_array_equal(back.cell_data["ERR"][0].ravel(), [0.25])
    np.testing.assert_array_equal(back.cell_data["ERR"][1].ravel(), [1.5, 2.5])


def test_hexahedra_and_tetrahedra_keep_a_positive_volume_in_the_order_of_vtk(tmp_path):
    write_mesh(tmp_path / "m.vtu", POINTS, BLOCKS)
    back = meshio.read(tmp_path / "m.vtu")
    x = back.points[back.cells_dict["hexahedron"]]
    # VTK: node 1, 3 and 4 are the neighbours of node 0
    assert (np.linalg.det(np.stack([x[:, 1] - x[:, 0], x[:, 3] - x[:, 0], x[:, 4] - x[:, 0]], axis=1)) > 0).all()


def test_plane_meshes_and_vectors_get_a_third_coordinate(tmp_path):
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    blocks = [("QUA4", np.array([[0, 1, 2, 3]])), ("SEG2", np.array([[0, 1]])), ("POI1", np.array([[2]]))]
    write_mesh(tmp_path / "m.vtu", points, blocks, point_data={"U": points, "T": points[:, :1]})
    back = meshio.read(tmp_path / "m.vtu")
    np.testing.assert_array_equal(back.points, np.c_[points, np.zeros(4)])
    np.testing.assert_array_equal(back.point_data["U"], np.c_[points, np.zeros(4)])
    assert back.point_data["T"].shape == (4,)
    assert [block.type for block in back.cells] == ["quad", "line", "vertex"]


@pytest.mark.parametrize(
    ("name", "blocks", "point_data", "cell_data"),
    [
        ("m.foo", BLOCKS, {}, {}),
        ("m.vtu", [("CUB9", np.arange(8)[None])], {}, {}),
        ("m.vtu", [("TET4", np.array([[0, 1, 2, 9]]))], {}, {}),
        ("m.vtu", [("TET4", np.array([[0, 1, 2, -1]]))], {}, {}),
        ("m.vtu", BLOCKS, {"T": np.zeros(8)}, {}),
        ("m.vtu", BLOCKS, {"S": np.zeros((9, 6))}, {}),
        ("m.vtu", BLOCKS, {}, {"E": [np.zeros(1)]}),
        ("m.vtu", BLOCKS, {}, {"E": [np.zeros(1), np.zeros(3)]}),
    ],
)
def test_what_cannot_be_written_is_refused_and_leaves_no_file(tmp_path, name, blocks, point_data, cell_data):
    with pytest.raises(BadValue):
        write_mesh(tmp_path / name, POINTS, blocks, point_data, cell_data)
    assert list(tmp_path.iterdir()) == []
