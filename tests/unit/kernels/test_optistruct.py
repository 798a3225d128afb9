"""Files of OptiStruct, written here by hand in the three forms of cards."""

import numpy as np
import pytest

from gibiane_ops.kernels.errors import UnreadableFile
from gibiane_ops.kernels.exchange.formats import read_mesh

CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0.5, 0.5, 2)]
HEAD = "$$ Optistruct Input Deck\nSUBCASE 1\n  SPC = 1\nBEGIN BULK\n"
TAIL = """CHEXA          7       1      11      12      13      14      15      16+
+             17      18
CPYRA          8       2      15      16      17      18      19
CTRIA3         9       5      11      12      13
RBE2           4      11  123456      12
CBAR          20       5      11      12      1.      0.      0.
$HMMOVE        2
$              8
$HMMOVE        3
$              7THRU           7       9
$HMNAME COMP                   2"top" 2 "PSOLID" 4
$HWCOLOR COMP                  2       5
$HMNAME COMP                   3"low part"
$HMSET        1        1 "base" 18
$HMSETTYPE    1 "regular" 18
SET            1    GRID    LIST
+             11    THRU      14
SET            2    ELEM    LIST
+              8       9
PSOLID         1       1
ENDDATA
"""


def small(label, x):
    return f"GRID    {label:8d}        {x[0]:8.4f}{x[1]:8.4f}{x[2]:8.4f}\n"


def large(label, x):
    return f"GRID*   {label:16d}{'':16}{x[0]:16.9e}{x[1]:16.9e}*\n*       {x[2]:16.9e}\n"


def free(label, x):
    return f"GRID,{label},,{x[0]},{x[1]},{x[2]:.1f}\n"


@pytest.mark.parametrize("form", [small, large, free])
def test_a_file_in_each_form_of_cards(tmp_path, form):
    path = tmp_path / "box.fem"
    path.write_text(HEAD + "".join(form(11 + i, x) for i, x in enumerate(CUBE)) + TAIL)
    mesh = read_mesh(path, "FEM")
    assert mesh.points == pytest.approx(np.array(CUBE, float))
    assert [name for name, _ in mesh.blocks] == ["CUB8", "PYR5", "TRI3"]
    assert mesh.blocks[0][1].tolist() == [list(range(8))]
    assert mesh.blocks[1][1].tolist() == [[4, 5, 6, 7, 8]]
    groups = {name: [(p, rows.tolist()) for p, rows in parts] for name, parts in mesh.groups.items()}
    assert groups == {"top": [(1, [0])], "low part": [(0, [0]), (2, [0])], "SET2": [(1, [0]), (2, [0])]}
    assert {name: nodes.tolist() for name, nodes in mesh.node_groups.items()} == {"base": [0, 1, 2, 3]}
    assert mesh.skipped == ("CBAR",)


def test_components_of_properties_and_exponents_without_letter(tmp_path):
    path = tmp_path / "one.fem"
    path.write_text(
        HEAD
        + "GRID           1           1.5-3      0.      0.\nGRID           2           -2.+1      0.\n"
        + "GRID           3          1.0D+1   1.E-1      0.\n"
        + 'CTRIA3         1       4       1       2       3\n$HMNAME COMP                   6"skin" 4 "PSHELL" 4\n'
        + "ENDDATA\n"
    )
    mesh = read_mesh(path, "FEM")
    assert mesh.points == pytest.approx(np.array([[1.5e-3, 0, 0], [-20, 0, 0], [10, 0.1, 0]]))
    assert list(mesh.groups) == ["skin"]


def test_a_file_that_is_cut_or_names_no_node(tmp_path):
    whole = HEAD + "".join(small(11 + i, x) for i, x in enumerate(CUBE)) + TAIL
    path = tmp_path / "cut.fem"
    for content, reason in (
        (whole[: len(whole) // 2], "ENDDATA"),
        (whole.replace("BEGIN BULK", ""), "BEGIN BULK"),
        (whole.replace("      18\nCPYRA", "      88\nCPYRA"), "node 88"),
        (whole.replace("+             17      18\n", ""), "cut or damaged"),
        (whole.replace("GRID          11        ", "GRID          11       3"), "coordinate system"),
    ):
        assert content != whole
        path.write_text(content)
        with pytest.raises(UnreadableFile, match=reason):
            read_mesh(path, "FEM")
