"""The closures of loops give what the queue machine gives, on random programs."""

import io

from hypothesis import given, settings
from hypothesis import strategies as st

from gibiane import Session

NAMES = ("A", "B", "N", "T.1", "T . 'X'", "&R", "UNKNOWN", "M")
numbers = st.one_of(
    st.integers(-20, 20).map(str),
    st.floats(-1e3, 1e3, allow_nan=False).map(lambda x: f"{x:.4f}"),
)
atoms = st.one_of(numbers, st.sampled_from(NAMES))
symbols = st.sampled_from(("+", "-", "*", "/", "**"))


def chain(operands: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.builds(
        lambda first, rest: " ".join([first, *(f"{s} {x}" for s, x in rest)]),
        operands,
        st.lists(st.tuples(symbols, operands), max_size=3),
    )


expressions = st.recursive(chain(atoms), lambda inner: chain(st.one_of(atoms, inner.map("({})".format))), max_leaves=6)
conditions = st.builds(
    "({} {} {})".format, atoms, st.sampled_from(("<", ">", "<EG", ">EG", "EGA")), st.one_of(atoms, numbers)
)
statements = st.one_of(
    st.builds("{} = {} ;".format, st.sampled_from(("A", "B", "N", "S")), expressions),
    st.builds("SI {} ; A = {} ; SINON ; B = {} ; FINSI ;".format, conditions, expressions, expressions),
    st.builds("S = DOUBLE {} ;".format, atoms),
    st.builds("T.1 = {} ;".format, expressions),
)
programs = st.lists(statements, min_size=1, max_size=5)


def outcome(body: list[str], closures: bool) -> tuple[str, int]:
    lines = [
        "OPTI ERRE IGNO ;",
        "DEBP DOUBLE x*FLOTTANT ; y = x * 2. ; FINP y ;",
        "A = 2 ; B = 0.5 ; N = 3 ; S = 0. ; M = MOT 'WORD' ; T = TABL ; T.1 = 4 ; T.'X' = 1.5 ;",
        "REPE R 12 ;",
        *body,
        "FIN R ;",
        "MESS (TYPE A) (TYPE B) (TYPE N) (TYPE S) ;",
        "MESS A ; MESS B ; MESS N ; MESS S ; MESS (T.1) ;",
    ]
    shown = io.StringIO()
    session = Session(out=shown, err=shown)
    session.evaluator.closures = closures
    code = session.run_text("\n".join(lines))
    return shown.getvalue(), code


@settings(max_examples=60, deadline=None)
@given(programs)
def test_same_results_and_messages(body: list[str]) -> None:
    assert outcome(body, closures=True) == outcome(body, closures=False)
