"""The runner of golden scripts: what it accepts, what it refuses, and that it leaves nothing behind."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gibiane import cli, goldens

ROOT = Path(__file__).parents[3]


def write(folder: Path, text: str, expected: str | None = None, name: str = "case") -> goldens.Golden:
    script = folder / f"{name}.dgibi"
    script.write_text(text, encoding="utf-8")
    if expected is not None:
        script.with_suffix(".out").write_text(expected, encoding="utf-8")
    return goldens.read(script)


def problem(golden: goldens.Golden) -> str | None:
    return goldens.difference(golden, goldens.run(golden))


def test_exact_by_default(tmp_path: Path) -> None:
    assert problem(write(tmp_path, "MESS 'x=' 1.5 ;", "x= 1.50000E+00\n")) is None
    told = problem(write(tmp_path, "MESS 'x=' 1.5 ;", "x= 1.50001E+00\n"))
    assert told is not None
    assert "-x= 1.50001E+00" in told
    assert "+x= 1.50000E+00" in told


@pytest.mark.parametrize(("tolerance", "agrees"), [("rtol=1e-4", True), ("rtol=1e-6", False), ("atol=1e-4", True)])
def test_numbers_within_tolerance(tmp_path: Path, tolerance: str, agrees: bool) -> None:
    golden = write(tmp_path, f"* golden: {tolerance}\nMESS 'x=' 1.5 ;", "x= 1.50001E+00\n")
    assert (problem(golden) is None) == agrees


def test_only_lines_that_differ_are_shown(tmp_path: Path) -> None:
    golden = write(
        tmp_path, "* golden: rtol=1e-3\nMESS 1.0001 ; MESS 2. ; MESS 'end' ;", " 1.00000E+00\n 3.00000E+00\nend\n"
    )
    told = problem(golden)
    assert told is not None
    assert "1.00010" not in told
    assert "+ 2.00000E+00" in told


def test_text_stays_exact_with_a_tolerance(tmp_path: Path) -> None:
    assert problem(write(tmp_path, "* golden: rtol=1.\nMESS 'abc' 1 ;", "abd1\n")) is not None


def test_three_digit_exponents_are_numbers(tmp_path: Path) -> None:
    golden = write(tmp_path, "* golden: rtol=1e-3\nMESS 1.0001E101 ;", " 1.00000+101\n")
    assert problem(golden) is None


def test_a_script_without_its_package_is_skipped(tmp_path: Path) -> None:
    assert write(tmp_path, "* golden: needs=no_such_package\nMESS 1 ;", "2\n").needs == "no_such_package"
    write(tmp_path, "MESS 1 ;", "1\n", name="other")
    said: list[str] = []
    assert goldens.main(tmp_path, accept=False, write=said.append) == 0
    assert said == [
        "SKIPPED case.dgibi: the package no_such_package is not installed\n",
        "1 golden scripts: 1 passed, 0 failed\n",
    ]


def test_exit_code_is_part_of_what_is_expected(tmp_path: Path) -> None:
    shown = "error[5]: ERREUR: a test of this script failed\n"
    assert "exit code 12; the header of the script says 0" in (problem(write(tmp_path, "ERRE 5 ;", shown)) or "")


def test_arguments_define_objects(tmp_path: Path) -> None:
    assert problem(write(tmp_path, "* golden: args=N=2,X=1.5\nMESS (N + 1) (TYPE X) ;", "3FLOTTANT\n")) is None


def test_masks_what_changes_from_run_to_run() -> None:
    text = " TABLE de pointeur 812\nMAILLAGE     12 : 5\n2024-05-01 12:30:59  TEMPS 0.25 s\nlast   \n\n"
    expected = " TABLE de pointeur P\nMAILLAGE P : 5\nDATE TIME  TEMPS T s\nlast\n"
    assert goldens.normalise(text) == expected


def test_nothing_is_written_beside_the_script(tmp_path: Path) -> None:
    write(tmp_path, "OPTI SORT 'there.txt' ; SORT 'CHAI' 1 ;", "")
    assert cli.main(["test", str(tmp_path)]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["case.dgibi", "case.out"]


def test_a_procedure_beside_the_script_is_found(tmp_path: Path) -> None:
    (tmp_path / "twice.procedur").write_text("DEBP TWICE x*ENTIER ; FINP (2 * x) ;\n", encoding="utf-8")
    assert problem(write(tmp_path, "MESS (TWICE 4) ;", "8\n")) is None


def test_messages_name_the_script_without_its_folder(tmp_path: Path) -> None:
    told = goldens.run(write(tmp_path, "X = 1 2 3 'a' ;"))
    assert "--> case.dgibi:1:" in told.text
    assert str(tmp_path) not in told.text


@pytest.mark.parametrize("setting", ["rtol=abc", "exit=", "speed=3"])
def test_a_wrong_header_is_told(tmp_path: Path, setting: str) -> None:
    with pytest.raises(goldens.BadHeader, match=setting.partition("=")[0]):
        write(tmp_path, f"* golden: {setting}\nMESS 1 ;")


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)
    write(tmp_path, "MESS 1 ;", "2\n", "one")
    assert cli.main(["test", str(tmp_path)]) == 1
    assert capsys.readouterr().out.endswith("1 golden scripts: 0 passed, 1 failed\n")
    assert cli.main(["test", str(tmp_path), "--bless"]) == 0
    assert (tmp_path / "one.out").read_text(encoding="utf-8") == "1\n"
    assert cli.main(["test", str(tmp_path)]) == 0
    assert cli.main(["test", str(tmp_path / "nowhere")]) == 2
    monkeypatch.setenv("CI", "1")
    assert cli.main(["test", str(tmp_path), "--bless"]) == 2


def test_the_working_folder_is_restored(tmp_path: Path) -> None:
    before = os.getcwd()
    goldens.run(write(tmp_path, "ERRE 5 ;"))
    assert os.getcwd() == before


def test_every_golden_of_this_project_has_its_output() -> None:
    scripts = goldens.discover(ROOT / "tests" / "golden", all_scripts=True)
    missing = [p.name for p in scripts if not p.with_suffix(".out").is_file() and not goldens.read(p).helper]
    assert missing == []
