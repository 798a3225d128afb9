"""Archives of a session: sharing, cut and foreign files, and names of classes that a file may not use."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gibiane.session import Session
from gibiane_ops.values.archive import Archive, BadArchive

SCRIPT = """OPTI DIME 3 ELEM CUB8 ;
S = (DROI 2 (0 0 0) (1 0 0)) TRAN 2 (0 1 0) ; V = S VOLU 2 'TRAN' (0 0 1) ;
MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 1. 'NU' 0.3 ; K = (RIGI MO MA) ET (BLOQ 'DEPL' S) ;
U = RESO K (FORC (0 0 1) (FACE 2 V)) ; T = TABL ; T.1 = V ; T.'T' = T ; L = SUIT U (2. * U) ;
OPTI 'SAUV' '{path}' ; SAUV ;
"""


def session() -> tuple[Session, io.StringIO, io.StringIO]:
    out, err = io.StringIO(), io.StringIO()
    return Session(out=out, err=err), out, err


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "all.zip"
    writer, _, err = session()
    assert writer.run_text(SCRIPT.format(path=path.as_posix())) == 0, err.getvalue()
    return path


def rest(path, before="", after=""):
    reader, out, err = session()
    code = reader.run_text(f"{before} OPTI 'REST' '{path.as_posix()}' ; REST ; {after}")
    return reader, code, out.getvalue(), err.getvalue()


@pytest.mark.parametrize("before", ["", "OPTI DIME 3 ELEM CUB8 ; A = DROI 5 (7 7 7) (8 8 8) ; P = 1 2 3 ;"])
def test_objects_that_share_share_again(saved, before):
    reader, code, _, err = rest(saved, before)
    assert code == 0, err
    names = reader.names()
    table, mesh, model, stiffness = names["T"], names["V"], names["MO"], names["K"]
    assert table.get("T") is table
    assert table.get(1) is mesh
    assert stiffness.matrices[0].mesh.blocks[0] is model.zones[0].mesh.blocks[0]
    corners = mesh.store.coords[mesh.nodes]
    np.testing.assert_array_equal(
        np.unique(corners, axis=0), np.unique(np.indices((3, 3, 3)).reshape(3, -1).T / 2, axis=0)
    )
    np.testing.assert_array_equal(names["U"].parts["UX"][0], stiffness.matrices[0].nodes)
    assert names["L"].objects[0] is names["U"]


def test_a_solution_from_what_was_restored(saved):
    after = "W = RESO K (FORC (0 0 1) (FACE 2 V)) ; MESS ((MAXI (EXCO 'UZ' (U - W)) 'ABS') < 1.E-12) ;"
    _, code, out, err = rest(saved, "OPTI DIME 3 ; A = 1 1 1 ;", after)
    assert (code, out) == (0, "VRAI\n"), err


@pytest.mark.parametrize("share", np.linspace(0, 0.999, 12))
def test_a_cut_file_is_named(saved, share):
    whole = saved.read_bytes()
    saved.write_bytes(whole[: int(share * len(whole))])
    _, code, _, err = rest(saved)
    assert code == 8
    assert "G501" in err


@pytest.mark.parametrize("seed", range(30))
def test_a_damaged_file_is_named_or_read(saved, seed):
    content = bytearray(saved.read_bytes())
    random = np.random.default_rng(seed)
    for place in random.integers(0, len(content), 20):
        content[place] = random.integers(0, 256)
    saved.write_bytes(bytes(content))
    reader, code, _, err = rest(saved)
    assert code in (0, 8)
    assert not reader.internal, err


def edited(path, change):
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    content = json.loads(files["session.json"])
    change(content, files)
    files["session.json"] = json.dumps(content).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)


@pytest.mark.parametrize(
    "change",
    [
        lambda c, f: c.update(format="gibiane session 999"),
        lambda c, f: c.update(names=[["X", {"object": 10**6}]]),
        lambda c, f: c.update(names=[["X", {"array": 10**6}]]),
        lambda c, f: c.update(names=[["X", {"call": "print"}]]),
        lambda c, f: c.pop("objects"),
        lambda c, f: c.update(objects=[{"class": "os:system", "state": {}}] * 200),
        lambda c, f: c.update(objects=[{"class": "gibiane_ops.values.archive:Path", "state": {}}] * 200),
        lambda c, f: c.update(objects=[{"class": "subprocess:Popen", "state": {}}] * 200),
        lambda c, f: c.update(objects=[{"class": "Procedure", "text": "MESS 'run' ; DEBP P ; FINP ;"}] * 200),
        lambda c, f: c.update(objects=[{"class": "Procedure", "text": "DEBP P ; FINP ; MESS 'run' ;"}] * 200),
        lambda c, f: c.update(objects=[{"class": "Texte", "text": "MESS 1 ; MESS 2"}] * 200),
        lambda c, f: f.update({"arrays/0.npy": b"\x80\x04]."}),
        lambda c, f: f.pop("arrays/0.npy"),
    ],
)
def test_a_foreign_content_is_refused_and_runs_nothing(saved, change):
    edited(saved, change)
    reader, code, out, err = rest(saved)
    assert code == 8
    assert "G501" in err
    assert out == ""
    assert not reader.internal


def test_pickled_arrays_are_refused(saved):
    def change(content, files):
        buffer = io.BytesIO()
        np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
        files["arrays/0.npy"] = buffer.getvalue()

    edited(saved, change)
    with pytest.raises(BadArchive):
        Archive(saved)


def test_nodes_before_the_first_one_used_stay_behind(tmp_path: Path) -> None:
    run, out, err = session()
    script = (
        "OPTI DIME 3 ELEM CUB8 ; A = (DROI 30 (0 0 0) (1 0 0)) TRAN 30 (0 1 0) ;"
        "B = DROI 2 (0 0 7) (4 0 7) ; L = PROG 1. 2. ;"
        f"OPTI SAUV '{tmp_path / 'line'}' ; SAUV B L ; OPTI SAUV '{tmp_path / 'list'}' ; SAUV L ;"
        f"OPTI REST '{tmp_path / 'line'}' ; REST ; MESS (MESU B) ' ' (COOR 3 (B POIN 3)) ;"
    )
    assert run.run_text(script) == 0, err.getvalue()
    assert out.getvalue().split()[-2:] == ["4.00000E+00", "7.00000E+00"]
    assert len(node_arrays(tmp_path / "line.gibi.zip")) == 3
    assert len(node_arrays(tmp_path / "list.gibi.zip")) == 0


def node_arrays(path: Path) -> np.ndarray:
    with zipfile.ZipFile(path) as archive:
        number = json.loads(archive.read("session.json"))["nodes"][0]["array"]
        return np.load(io.BytesIO(archive.read(f"arrays/{number}.npy")), allow_pickle=False)
