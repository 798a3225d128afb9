"""Every declared operator is documented, its example runs, and the table of families agrees with the declarations."""

import io
import re
from importlib import import_module
from pathlib import Path

import pytest

import gibiane_ops
from gibiane import Session, registry
from gibiane.notice import describe, header, operators
from gibiane.registry import Operator
from gibiane_ops.kernels.elements.table import SHAPES
from gibiane_ops.options import ELEMENTS

Session(out=io.StringIO())
EVERY = operators()
ROOT = Path(__file__).parents[2]
BY_NAME = pytest.mark.parametrize("op", EVERY, ids=lambda op: op.name)


@BY_NAME
def test_is_documented(op: Operator) -> None:
    assert op.summary
    assert not op.summary.endswith(".")
    assert op.notice
    assert op.example
    assert op.forms
    text = describe(op)
    assert text.startswith(f"{op.name}: {op.summary}")
    for form in op.forms:
        assert " ".join(form.usage(op.name).split()) in " ".join(text.split())  # long ones are wrapped


@BY_NAME
def test_example_runs(op: Operator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    out = io.StringIO()
    code = Session(out=out, err=out).run_text(op.example, f"example of {op.name}")
    shown = out.getvalue()
    # An example of OPTI ERRE IGNO fails once, on purpose.
    assert code == 0 or ("OPTI ERRE IGNO" in op.example and shown.count("error[") == 1), shown


@BY_NAME
def test_see_also_names_operators(op: Operator) -> None:
    for name in op.see:
        found = registry.find(name)
        assert found is not None, name
        assert name in (found.name, found.name[:4])


def test_table_of_families_agrees_with_the_declarations() -> None:
    modules = {m for names in gibiane_ops.OPERATORS.values() for m in names}
    for module in modules:
        import_module(module)
    declared = {op.name for op in EVERY}
    assert set(gibiane_ops.OPERATORS) <= declared
    for name, homes in gibiane_ops.OPERATORS.items():
        op = registry.find(name)
        assert op is not None
        homes_of_forms = {form.function.__module__ for form in op.forms}
        assert set(homes) <= homes_of_forms, name
        assert {m for m in homes_of_forms if m.startswith("gibiane_ops")} <= set(homes), name


def test_no_declaration_is_missing_from_the_table() -> None:
    """An operator that the table does not list can be declared and tested, but no script finds it."""
    declaring = re.compile(r'\b(?:operator|infix|extend)\(\s*"([^"]+)"')
    declared = set()
    for path in ROOT.glob("ops/gibiane_ops/**/*.py"):
        module = ".".join(path.relative_to(ROOT / "ops").with_suffix("").parts)
        for name in declaring.findall(path.read_text(encoding="utf-8")):
            op = registry.find(name)
            declared.add((name if op is None else op.name, module))
    assert declared
    assert declared <= {(name, module) for name, homes in gibiane_ops.OPERATORS.items() for module in homes}


def test_element_types_of_opti_are_the_known_shapes() -> None:
    assert set(ELEMENTS) == set(SHAPES)


def test_every_procedure_has_a_header_and_a_caller() -> None:
    procedures = list(ROOT.glob("scripts/**/*.procedur"))
    texts = {path: path.read_text(encoding="utf-8").upper() for path in procedures}
    scripts = [*ROOT.glob("tests/**/*.dgibi"), *ROOT.glob("examples/**/*.dgibi"), *ROOT.glob("tests/**/*.py")]
    callers = "\n".join(path.read_text(encoding="utf-8", errors="replace").upper() for path in scripts)
    for path, text in texts.items():
        name = path.stem.upper()
        assert text.startswith(f"$$$$ {name}"), path
        assert len(header(name, text)) > len(f"{name}: A PROCEDURE") + 20, path
        others = "\n".join(other for of, other in texts.items() if of != path)
        assert re.search(rf"\b{name}\b", callers + others), f"nothing calls {path}"


def keywords() -> list[tuple[str, str]]:
    return sorted({(op.name, word) for op in EVERY for form in op.forms for key in form.keys for word in key.words})


def test_every_keyword_appears_in_a_script() -> None:
    """In a golden script, an example or a procedure: by its first four letters."""
    scripts = [
        *ROOT.glob("tests/golden/**/*.dgibi"),
        *ROOT.glob("examples/**/*.dgibi"),
        *ROOT.glob("scripts/**/*.procedur"),
    ]
    text = "\n".join(
        [*(p.read_text(encoding="utf-8", errors="replace") for p in scripts), *(op.example for op in EVERY)]
    )
    used = {word[:4] for word in re.findall(r"[A-Z][A-Z0-9_]*", text.upper())}
    missing = [f"{name} '{word}'" for name, word in keywords() if word[:4] not in used]
    assert not missing, f"{len(missing)} keywords that nothing tries: {', '.join(missing)}"


def example_of(path: Path) -> str:
    """Return the lines of a procedure's header that follow its word Example."""
    header = path.read_text(encoding="utf-8").split("\nDEBP", 1)[0]
    _, _, after = header.partition("* Example:\n")
    return "\n".join(line.removeprefix("*") for line in after.splitlines())


PROCEDURES = {path.stem: path for path in sorted(ROOT.glob("scripts/**/*.procedur"))}
WITH_EXAMPLE = [name for name, path in PROCEDURES.items() if example_of(path).strip()]


def test_procedures_that_users_call_first_show_an_example() -> None:
    assert {"adapter", "richardson"} <= set(WITH_EXAMPLE)


@pytest.mark.parametrize("name", WITH_EXAMPLE)
def test_example_of_a_procedure_runs(name: str) -> None:
    out = io.StringIO()
    code = Session(out=out, err=out).run_text(example_of(PROCEDURES[name]), f"example of {name}")
    assert code == 0, out.getvalue()
    assert out.getvalue().strip()
