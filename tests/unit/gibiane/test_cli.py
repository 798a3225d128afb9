"""The command line: what it runs, what it prints where, and its exit codes."""

import io
import subprocess
import sys
from pathlib import Path

import pytest

from gibiane.cli import main

Captured = pytest.CaptureFixture[str]


def test_text(capsys: Captured) -> None:
    assert main(["-c", "MESS (1 + 2 * 3) ;"]) == 0
    assert capsys.readouterr() == ("9\n", "")


def test_definitions_on_the_command_line(tmp_path: Path, capsys: Captured) -> None:
    script = tmp_path / "scene.dgibi"
    script.write_text("MESS (TYPE N) (TYPE X) (TYPE L) W ;\n", encoding="utf-8")
    assert main([str(script), "N=4", "X=2.5", "L=VRAI", "W=steel"]) == 0
    assert capsys.readouterr().out == "ENTIER  FLOTTANTLOGIQUE steel\n"


def test_standard_input(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO("MESS 'été' ;".encode("latin-1"))))
    assert main(["-"]) == 0
    assert capsys.readouterr().out == "été\n"


@pytest.mark.parametrize(("text", "code", "level"), [
    ("ERRE 0 ;", 0, None),
    ("ERRE 'boum' ;", 8, 2),
    ("ERRE 5 ;", 12, 3),
    ("OPTI ERRE IGNO ; X = PROG 'a' ; MESS 'on' ; FIN ;", 8, 2),
])  # fmt: skip
def test_exit_codes(text: str, code: int, level: int | None, capsys: Captured) -> None:
    assert main(["-c", text]) == code
    shown = capsys.readouterr().err
    assert ("Niveau d'erreur" in shown) == (level is not None)
    if level is not None:
        assert f"Niveau d'erreur: {level} " in shown


def test_missing_script_names_a_similar_one(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "poutre.dgibi").write_text("MESS 1 ;", encoding="utf-8")
    assert main([str(tmp_path / "poutr.dgibi")]) == 8
    shown = capsys.readouterr().err
    assert shown.startswith("error[1130]: the script ")
    assert "poutre.dgibi" in shown


def test_folder_and_binary_file_are_no_scripts(tmp_path: Path, capsys: Captured) -> None:
    assert main([str(tmp_path)]) == 8
    assert "is a folder" in capsys.readouterr().err
    binary = tmp_path / "x.dgibi"
    binary.write_bytes(b"MESS 1 ;\0\1\2")
    assert main([str(binary)]) == 8
    assert capsys.readouterr().err.startswith("error[G101]")


@pytest.mark.parametrize("arguments", [
    ["--nonsense"], ["-x"], ["-c"], ["-i"], ["check"], ["info"], ["--echo", "9"], ["--lang", "de"],
    ["-c", "MESS 1 ;", "1=2"],
])  # fmt: skip
def test_wrong_command_lines(arguments: list[str], capsys: Captured) -> None:
    assert main(arguments) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("gibiane: ")
    assert "usage: gibiane FILE" in shown


def test_check_reports_every_error_and_runs_nothing(tmp_path: Path, capsys: Captured) -> None:
    script = tmp_path / "x.dgibi"
    script.write_text("MESS 'run' ;\nX = (1 + 2 ;\nY = 3) ;\nSI VRAI ;\n", encoding="utf-8")
    assert main(["check", str(script)]) == 8
    out, err = capsys.readouterr()
    assert out == ""
    assert [line.split(":")[0] for line in err.splitlines() if line.startswith("error")][:2] == ["error[1]", "error[2]"]
    script.write_text("MESS 'run' ;\n", encoding="utf-8")
    assert main(["check", str(script)]) == 0
    assert capsys.readouterr() == ("", "")


def test_info(capsys: Captured) -> None:
    assert main(["info", "RESO"]) == 0
    assert capsys.readouterr().out.startswith("RESO: ")
    assert main(["info", "RESOU_"]) in (0, 8)


def test_version_and_help(capsys: Captured) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("gibiane ")
    assert main(["--help"]) == 0
    assert "usage: gibiane" in capsys.readouterr().out


def test_start_imports_no_numerical_package() -> None:
    code = (
        "import sys\nfrom gibiane.cli import main\nmain(['-c', 'MESS 1 ;'])\n"
        "heavy = {'numpy', 'scipy', 'gmsh', 'meshio', 'matplotlib', 'prompt_toolkit'} & set(sys.modules)\n"
        "print(sorted(heavy))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONPATH": ":".join(p for p in sys.path if p), "PATH": "/usr/bin:/bin"},
    )
    assert done.stdout == "1\n[]\n"


def test_python_m_gibiane() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "gibiane", "-c", "MESS 2 ;"],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONPATH": ":".join(p for p in sys.path if p), "PATH": "/usr/bin:/bin"},
    )
    assert done.stdout == "2\n"
