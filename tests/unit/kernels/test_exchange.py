"""Mesh files: round trips in every format, groups, and damaged files."""

from importlib.util import find_spec

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.errors import BadValue, MissingPackage, UnreadableFile
from gibiane_ops.kernels.exchange.formats import FORMATS, read_mesh, write_mesh_file
from gibiane_ops.kernels.exchange.meshfile import MeshFile

SOLIDS = ["TET4", "PYR5", "PRI6", "CUB8", "TE10", "PY13", "PR15", "CU20"]
PLANE = ["SEG2", "SEG3", "TRI3", "TRI6", "QUA4", "QUA8"]
HELD = {
    "MED": SOLIDS + PLANE,
    "UNV": ["SEG2", "SEG3", "TRI3", "TRI6", "QUA4", "QUA8", "TET4", "TE10", "PRI6", "PR15", "CUB8", "CU20"],
    "NAS": ["SEG2", "TRI3", "TRI6", "QUA4", "QUA8", "TET4", "TE10", "PYR5", "PRI6", "PR15", "CUB8", "CU20"],
    "ABAQ": ["SEG2", "SEG3", "TRI3", "TRI6", "QUA4", "QUA8", "TET4", "TE10", "PRI6", "PR15", "CUB8", "CU20"],
    "AVS": ["SEG2", "TRI3", "QUA4", "TET4", "PYR5", "PRI6", "CUB8"],
    "GMSH": SOLIDS + PLANE,
    "VTK": SOLIDS + PLANE,
}
CASES = [(word, name) for word, names in HELD.items() for name in names]


def one(name: str, copies: int = 3) -> MeshFile:
    """Elements side by side, stretched so that no coordinate is a round number."""
    of = shape(name)
    points, cells = [], []
    for i in range(copies):
        nodes = np.zeros((of.n_nodes, 3))
        nodes[:, : of.dim] = of.ref_nodes @ (np.eye(of.dim) * 0.1234567 + 0.01)
        cells.append(np.arange(of.n_nodes) + i * of.n_nodes)
        points.append(nodes + [np.pi * i, 0, 0])
    return MeshFile(np.vstack(points), [(name, np.array(cells))])


def tolerance(word: str) -> float:
    # Nastran writes coordinates in 16 columns
    return 1e-8 if word == "NAS" else 1e-14


def skip_without(word: str) -> None:
    if word == "MED" and find_spec("h5py") is None:
        pytest.skip("h5py is not installed")


@pytest.mark.parametrize(("word", "name"), CASES)
def test_nodes_and_elements_come_back(tmp_path, word, name):
    skip_without(word)
    mesh = one(name)
    path = tmp_path / f"mesh{FORMATS[word].extension}"
    write_mesh_file(path, word, mesh)
    found = read_mesh(path, word)
    assert [n for n, _ in found.blocks] == [name]
    np.testing.assert_allclose(found.points[found.blocks[0][1]], mesh.points[mesh.blocks[0][1]], atol=tolerance(word))


@pytest.mark.parametrize("word", [w for w in HELD if FORMATS[w].tag or w in ("UNV", "ABAQ")])
def test_groups_come_back(tmp_path, word):
    skip_without(word)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    lines = np.array([[0, 1], [1, 2]])
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]])
    mesh = MeshFile(points, [("QUA4", quads), ("SEG2", lines)])
    mesh.groups = {"LEFT": [(0, np.array([0]))], "RIGHT": [(0, np.array([1]))], "BASE": [(1, np.array([0, 1]))]}
    if word in ("MED", "UNV", "ABAQ", "GMSH"):
        mesh.groups["PLATE"] = [(0, np.array([0, 1]))]
    path = tmp_path / "mesh"
    write_mesh_file(path, word, mesh)
    found = read_mesh(path, word)
    names = dict(zip(mesh.groups, [f"REF{i}" for i in range(1, 9)], strict=False))
    for group in mesh.groups:
        own = names[group] if word in ("NAS", "AVS") else group
        expected = sorted(found.points[c].tolist() for _, b in mesh.group_blocks(group) for c in b)
        assert sorted(found.points[c].tolist() for _, b in found.group_blocks(own) for c in b) == expected
    assert sum(len(c) for _, c in found.blocks) == 4


@pytest.mark.parametrize("word", ["UNV", "ABAQ"])
def test_groups_of_nodes_come_back(tmp_path, word):
    mesh = one("TRI3", 2)
    mesh.node_groups = {"CORNER": np.array([0, 4])}
    write_mesh_file(tmp_path / "mesh", word, mesh)
    np.testing.assert_array_equal(read_mesh(tmp_path / "mesh", word).node_groups["CORNER"], [0, 4])


@pytest.mark.parametrize("word", ["AVS", "GMSH", "MED"])
def test_fields_of_nodes_come_back(tmp_path, word):
    skip_without(word)
    mesh = one("TET4", 2)
    mesh.point_data = {"temperature": np.linspace(0, 1, len(mesh.points))}
    write_mesh_file(tmp_path / "mesh", word, mesh)
    found = read_mesh(tmp_path / "mesh", word).point_data["temperature"]
    np.testing.assert_allclose(np.ravel(found), mesh.point_data["temperature"], atol=1e-12)


def test_stl_holds_triangles_and_halves_of_quadrangles(tmp_path):
    mesh = one("QUA4", 2)
    write_mesh_file(tmp_path / "skin.stl", "STL", mesh)
    found = read_mesh(tmp_path / "skin.stl", "STL")
    assert [(n, len(c)) for n, c in found.blocks] == [("TRI3", 4)]
    edges = np.diff(found.points[found.blocks[0][1]], axis=1)
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    corners = mesh.points[mesh.blocks[0][1][0]]
    exact = np.linalg.norm(np.cross(corners[1] - corners[0], corners[3] - corners[0]))
    assert areas.sum() == pytest.approx(2 * exact, rel=1e-6)
    with pytest.raises(BadValue, match="TRI3 or QUA4"):
        write_mesh_file(tmp_path / "solid.stl", "STL", one("CUB8"))


@pytest.mark.parametrize("word", [w for w in FORMATS if w != "MED"])
@pytest.mark.parametrize("content", [b"", b"hello\n", bytes(range(256)) * 20, b"<html></html>"])
def test_foreign_files_are_named(tmp_path, word, content, capsys):
    path = tmp_path / "odd"
    path.write_bytes(content)
    with pytest.raises(UnreadableFile) as caught:
        read_mesh(path, word)
    assert "odd" in str(caught.value)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("word", ["UNV", "GMSH", "VTK", "AVS"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.7, 0.9])
def test_cut_files_are_named(tmp_path, word, share):
    path = tmp_path / f"mesh{FORMATS[word].extension}"
    write_mesh_file(path, word, one("CUB8", 40))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(UnreadableFile):
        read_mesh(path, word)


def test_an_element_that_the_format_has_not(tmp_path):
    with pytest.raises(BadValue, match="PYR5"):
        write_mesh_file(tmp_path / "mesh.unv", "UNV", one("PYR5"))
    with pytest.raises(BadValue):
        write_mesh_file(tmp_path / "mesh.inp", "ABAQ", one("PYR5"))


def test_med_without_its_package(tmp_path, monkeypatch):
    monkeypatch.setattr("gibiane_ops.kernels.exchange.formats.find_spec", lambda name: None)
    with pytest.raises(MissingPackage, match="h5py"):
        read_mesh(tmp_path / "mesh.med", "MED")


def test_unv_of_another_hand(tmp_path):
    text = """    -1
   781
         1         0         0        11
  0.0000000000000000D+00  0.0000000000000000D+00  0.0000000000000000D+00
         7         0         0        11
  1.0000000000000000D+00  0.0000000000000000D+00  0.0000000000000000D+00
        20         0         0        11
  0.0000000000000000D+00  2.0000000000000000D+00  0.0000000000000000D+00
    -1
    -1
  2412
         5        21         2         1         7         2
         0         1         1
         1         7
         9       161         1         1         7         1
        20
         6        41         1         1         7         3
         1         7        20
    -1
    -1
  2467
         1         0         0         0         0         0         0         3
TIP
         8         6         0         0         7        20         0         0
         8         5         0         0
    -1
"""
    path = tmp_path / "hand.unv"
    path.write_text(text)
    found = read_mesh(path, "UNV")
    assert [(n, c.tolist()) for n, c in found.blocks] == [("SEG2", [[0, 1]]), ("TRI3", [[0, 1, 2]])]
    assert found.skipped == ("element 161",)
    assert found.node_groups["TIP"].tolist() == [2]
    assert [(n, c.tolist()) for n, c in found.group_blocks("TIP")] == [("SEG2", [[0, 1]]), ("TRI3", [[0, 1, 2]])]
