"""The tables of examples/effectivite: every estimate and element, known stresses in a plane and in space."""

import io
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gibiane import Session

EXAMPLES = Path(__file__).parents[2] / "examples" / "effectivite"
NAMES = ("MOYE", "MOYC", "PROJ", "SPR", "SPRE", "RESI", "RDC")
SMOOTH = ("bending", "tube", "hole")
SINGULAR = {"L corner": 0.5445, "crack": 0.5}
"""Problems and the exponent of their displacement, which the energy of the error follows on uniform meshes."""

ELEMENTS = ("QUA4", "TRI3")
QUADRATIC = ("QUA8", "TRI6")


@lru_cache
def table() -> dict[tuple[str, str, int], dict]:
    """(problem, element, N) to the relative error, theta and SD by estimate, and whether RDC is guaranteed."""
    found = rows("plans", 3)
    assert len(found) == 54
    return found


def rows(scene: str, n: int) -> dict[tuple[str, str, int], dict]:
    """Run a scene with n meshes; read its rows."""
    out = io.StringIO()
    session = Session(out=out, err=io.StringIO())
    session.globals.names["NMAX"] = n
    assert session.run_text((EXAMPLES / scene / "scene.dgibi").read_text()) == 0, out.getvalue()
    lines = out.getvalue().splitlines()
    found = {}
    for head, theta, scatter in zip(lines[1::3], lines[2::3], lines[3::3], strict=True):
        name, rest = head[:10].strip(), head[10:].split()
        found[name, rest[0], int(rest[1])] = {
            "error": float(rest[3]), "guaranteed": rest[-1] == "VRAI",
            "theta": dict(zip(NAMES, map(float, theta.split()[1:]), strict=False)),
            "SD": dict(zip(NAMES, map(float, scatter.split()[1:]), strict=False)),
        }  # fmt: skip
    return found


def test_coarse_meshes():
    for (name, element, n), row in rows("plans", 1).items():
        assert row["guaranteed"] == (element in ELEMENTS or name in SINGULAR)
        assert (1 if row["guaranteed"] else 0.97) <= row["theta"]["RDC"] <= 1.2, (name, element, n)
        if element in ELEMENTS and name in ("bending", "tube"):
            assert 0.8 <= row["theta"]["SPR"] <= 1.2, (name, element)


@pytest.mark.slow
@pytest.mark.parametrize("element", ELEMENTS)
def test_uniform_refinement_shows_the_regularity(element):
    for name in (*SMOOTH, *SINGULAR):
        rate = np.log2(table()[name, element, 12]["error"] / table()[name, element, 24]["error"])
        wanted = SINGULAR.get(name, 1.0)
        # bending and the tube are past their first meshes; the hole, meshed by chords, is not quite (0.87, 0.90)
        assert rate == pytest.approx(wanted, abs=0.15 if name == "hole" else 0.05), name


@pytest.mark.slow
@pytest.mark.parametrize("element", ELEMENTS)
def test_patches_are_good_on_smooth_problems(element):
    for name in SMOOTH:
        fine, coarse = table()[name, element, 24], table()[name, element, 12]
        for method in ("SPR", "SPRE"):
            assert 0.8 <= fine["theta"][method] <= 1.2, (name, method)
            assert fine["SD"][method] <= 0.2, (name, method)
            # asymptotically exact, and more even, as the mesh is refined
            assert abs(fine["theta"][method] - 1) <= abs(coarse["theta"][method] - 1) + 1e-3, (name, method)
            assert fine["SD"][method] < coarse["SD"][method], (name, method)


@pytest.mark.slow
@pytest.mark.parametrize("element", ELEMENTS)
def test_estimates_follow_a_singular_error(element):
    # neither asymptotically exact nor worse with the size: theta stays what it is
    for name in SINGULAR:
        fine, coarse = table()[name, element, 24], table()[name, element, 12]
        for method in NAMES:
            assert fine["theta"][method] == pytest.approx(coarse["theta"][method], abs=0.02), (name, method)
            assert fine["theta"][method] > 0.55, (name, method)


@pytest.mark.slow
@pytest.mark.parametrize("element", ELEMENTS)
def test_equilibrated_stresses_bound_every_error(element):
    for (name, of, n), row in table().items():
        if of != element:
            continue
        assert list(row["theta"]) == list(NAMES)
        assert row["guaranteed"], (name, n)
        # The cells of the equilibrated stress are made smaller where it is singular.
        assert 1 <= row["theta"]["RDC"] <= 1.05, (name, n)


@pytest.mark.slow
@pytest.mark.parametrize("element", QUADRATIC)
def test_quadratic_elements_want_patches(element):
    for name in ("tube", "hole", *SINGULAR):
        fine, coarse = table()[name, element, 24], table()[name, element, 12]
        rate = np.log2(coarse["error"] / fine["error"])
        # elements graded towards the hole: 1.84 here, still rising
        wanted, near = (SINGULAR[name], 0.05) if name in SINGULAR else (2.0, 0.25 if name == "hole" else 0.03)
        assert rate == pytest.approx(wanted, abs=near), name
        theta = fine["theta"]
        assert list(theta) == list(NAMES)
        # straight sides: a bound; on the chords of curved ones the stress is no worse
        for n in (6, 12, 24):
            row = table()[name, element, n]
            assert row["guaranteed"] == (name in SINGULAR)
            assert (1 if row["guaranteed"] else 0.97) <= row["theta"]["RDC"] <= 1.2, (name, n)
        # residuals follow the error at its rate, whatever it is; that of the hole is not reached yet
        assert theta["RESI"] == pytest.approx(coarse["theta"]["RESI"], rel=0.06 if name == "hole" else 0.03)
        if name in SINGULAR:
            for method in ("SPR", "SPRE"):
                assert theta[method] == pytest.approx(coarse["theta"][method], abs=0.02)
                assert 0.9 <= theta[method] <= 1.15
            continue
        for method in ("SPR", "SPRE"):
            assert 0.8 <= theta[method] <= 1.2
            assert fine["SD"][method] <= 0.2
        # what is known of the loads brings the patches nearer, or within a hundredth
        assert abs(theta["SPRE"] - 1) <= max(abs(theta["SPR"] - 1), 0.01)
        assert 0.5 < theta["RESI"] < 1.5
        # nodal means and the projection stay near the stresses that they smooth, values of centres go far away
        assert max(theta["MOYE"], theta["PROJ"]) < 0.7
        assert theta["MOYC"] > 4


@pytest.mark.slow
def test_estimates_in_space():
    found = rows("espace", 1)
    assert len(found) == 18
    for (name, element, _), row in found.items():
        theta = row["theta"]
        if element in ("CU20", "TE10"):
            # coarse: 4 elements along the thickness of the tube, 1.6 and 1.8 there
            assert 1 <= theta["SPR"] <= 2
            assert list(theta) == list(NAMES)
            assert row["guaranteed"] == (name != "tube")
            assert (1 if row["guaranteed"] else 0.95) <= theta["RDC"] <= 1.35
            assert 0.95 <= theta["SPRE"] <= 2
            assert 0.5 < theta["RESI"] < 2
            assert max(theta["MOYE"], theta["PROJ"]) < (0.75 if name == "tube" else 0.9)
            continue
        assert list(theta) == list(NAMES)
        smooth = name in ("bending", "tube")
        for method in ("SPR", "SPRE"):
            low, high = (0.85, 1.1) if smooth else (0.75, 1.1)
            assert low <= theta[method] <= high, (name, element, method)
        assert row["guaranteed"]
        most = 1.1 if smooth or element == "TET4" else 1.15
        assert 1 <= theta["RDC"] <= most, (name, element)
