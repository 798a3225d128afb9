"""Which solver for which system."""

import pytest

from gibiane_ops.kernels import choice
from gibiane_ops.kernels.choice import choose, direct_memory
from gibiane_ops.kernels.memory import _group, available_memory

GB = 1e9


@pytest.fixture
def packages(monkeypatch):
    found = {"rslab", "superlu"}
    monkeypatch.setattr(choice, "is_installed", lambda name: name in found)
    return found


def test_small_systems_and_plane_systems_are_factorised(packages):
    assert choose(4_000, 10**5, 3, 1, memory=8 * GB).method == "auto"
    assert choose(14_000, 10**6, 3, 1, memory=8 * GB).method == "single"
    assert choose(300_000, 10**7, 2, 1, memory=8 * GB).method == "single"
    assert choose(300_000, 10**7, 2, 100, memory=8 * GB).method == "auto"


def test_few_solutions_of_a_large_solid_are_iterated_and_many_are_not(packages):
    assert choose(106_000, 8 * 10**6, 3, 1, memory=16 * GB).method == "amg"
    assert choose(106_000, 8 * 10**6, 3, 20, memory=16 * GB).method == "single"
    assert choose(106_000, 8 * 10**6, 3, 100, memory=16 * GB).method == "auto"


def test_what_does_not_fit_is_iterated_without_a_factorisation_in_reserve(packages):
    found = choose(1_170_000, 92 * 10**6, 3, 2000, memory=16 * GB)
    assert (found.method, found.reserve) == ("amg", False)
    assert found.memory < 4 * GB < direct_memory(1_170_000, 3)


def test_the_user_decides(packages):
    assert choose(1_000_000, 10**7, 3, 1, wish="DIRE", memory=GB).direct
    assert choose(100, 10**3, 3, 1, wish="ITER", memory=8 * GB).method == "amg"
    assert choose(100, 10**3, 3, 1, wish="ITER", definite=False, memory=8 * GB).method == "minres"


def test_without_rigid_modes_or_a_positive_diagonal(packages):
    assert choose(106_000, 8 * 10**6, 3, 1, elastic=False, memory=16 * GB).method == "single"
    assert choose(106_000, 8 * 10**6, 3, 1, definite=False, memory=16 * GB).method == "auto"
    assert choose(1_170_000, 92 * 10**6, 3, 1, elastic=False, memory=16 * GB).method == "cg"
    assert choose(1_170_000, 92 * 10**6, 3, 1, definite=False, memory=16 * GB).method == "minres"


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("solutions", [1, 1000])
def test_superlu_takes_nothing_large(packages, dim, solutions):
    packages.discard("rslab")
    found = choose(31_000, 10**6, dim, solutions, memory=16 * GB)
    assert (found.method, found.reserve) == ("amg", False)
    assert choose(29_000, 10**6, dim, 1000, memory=16 * GB).method == "auto"
    assert choose(10_000, 10**5, dim, 1, memory=16 * GB).method == "auto"


def test_memory_of_this_machine_is_a_sane_number():
    assert available_memory() > 1e7


def test_memory_of_a_container(tmp_path):
    assert _group(tmp_path) == float("inf")
    (tmp_path / "memory.max").write_text("1000\n")
    (tmp_path / "memory.current").write_text("600\n")
    (tmp_path / "memory.stat").write_text("anon 300\ninactive_file 200\n")
    assert _group(tmp_path) == 600
    (tmp_path / "memory.max").write_text("max\n")
    assert _group(tmp_path) == float("inf")
