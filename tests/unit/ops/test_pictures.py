"""What the session says and does about pictures."""

import pytest

from gibiane.session import Session
from gibiane_ops.kernels.plot import vtk_image, window

CUBE = (
    "OPTI DIME 3 ELEM CUB8 {option} ; S = (DROI 1 (0. 0. 0.) (1. 0. 0.)) TRAN 1 (0. 1. 0.) ;"
    " V = S VOLU 1 'TRAN' (0. 0. 1.) ; "
)


def test_a_library_that_vtk_lacks_is_told_once_and_the_picture_is_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(vtk_image, "obstacle", lambda: "libEGL.so.1")
    monkeypatch.setattr(vtk_image, "render", None)  # would fail if it were called
    Session().run_text(CUBE.format(option="FTRA 'a'") + "TRAC V ; TRAC V ;")
    told = capsys.readouterr().err
    assert told.count("VTK cannot draw here (no libEGL.so.1)") == 1
    assert "apt install libegl1 " in told
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a_001.png", "a_002.png"]


@pytest.mark.parametrize(
    ("interactive", "option", "words", "opened"),
    [
        (True, "", "", 1),
        (False, "", "", 0),
        (True, "FTRA 'a'", "", 0),
        (True, "", "'NCLK'", 0),
    ],
)
def test_a_window_opens_at_the_prompt_unless_a_file_is_named(tmp_path, monkeypatch, interactive, option, words, opened):
    monkeypatch.chdir(tmp_path)
    shown = []
    monkeypatch.setattr(vtk_image, "obstacle", lambda: None)
    monkeypatch.setattr(vtk_image, "render", lambda *a: (_ for _ in ()).throw(AssertionError("VTK")))
    monkeypatch.setattr(window, "screen_exists", lambda: True)
    monkeypatch.setattr(window, "show_scene", lambda layers, **options: shown.append("scene"))
    monkeypatch.setattr(window, "show_picture", lambda path, **options: shown.append(path.exists()))
    session = Session(interactive=interactive)
    session.run_text(CUBE.format(option=option) + f"TRAC V {words} ;" if opened else CUBE.format(option=option))
    assert shown == ["scene"] * opened
    session.run_text(f"E = EVOL 'MANU' (PROG 0. 1.) (PROG 0. 1.) ; DESS E {words} ;")
    assert shown[opened:] == [True] * opened
    files = list(tmp_path.rglob("*.png"))
    assert len(files) == 1 - opened
