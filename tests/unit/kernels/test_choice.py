"""Which solver for which system."""

import pytest

from gibiane_ops.kernels import choice
from gibiane_ops.kernels.choice import available_memory, choose, direct_memory

GB = 1e9


@pytest.fixture
def packages(monkeypatch):
    found = {"rslab", "amg", "superlu"}
    monkeypatch.setattr(choice, "is_installed", lambda name: name in found)
    return found


def test_small_systems_and_plane_systems_are_factorised(packages):
    assert choose(20_000, 10**6, 3, 1, memory=8 * GB).method == "auto"
    assert choose(300_000, 10**7, 2, 1, memory=8 * GB).method == "auto"


def test_one_solution_of_a_large_solid_is_iterated_and_several_are_not(packages):
    assert choose(106_000, 8 * 10**6, 3, 1, memory=16 * GB).method == "amg"
    assert choose(106_000, 8 * 10**6, 3, 7, memory=16 * GB).method == "auto"


def test_what_does_not_fit_is_iterated_without_a_factorisation_in_reserve(packages):
    found = choose(1_170_000, 92 * 10**6, 3, 20, memory=16 * GB)
    assert (found.method, found.reserve) == ("amg", False)
    assert found.memory < 4 * GB < direct_memory(1_170_000, 3)


def test_the_user_decides(packages):
    assert choose(1_000_000, 10**7, 3, 1, wish="DIRE", memory=GB).method == "auto"
    assert choose(100, 10**3, 3, 1, wish="ITER", memory=8 * GB).method == "amg"


def test_without_multigrid_or_rigid_modes(packages):
    assert choose(106_000, 8 * 10**6, 3, 1, elastic=False, memory=16 * GB).method == "auto"
    packages.discard("amg")
    assert choose(106_000, 8 * 10**6, 3, 1, memory=16 * GB).method == "auto"
    assert choose(1_170_000, 92 * 10**6, 3, 1, memory=16 * GB).method == "cg"


def test_multigrid_comes_before_superlu(packages):
    packages.discard("rslab")
    assert choose(106_000, 8 * 10**6, 3, 20, memory=16 * GB).method == "amg"


def test_memory_of_this_machine_is_a_sane_number():
    assert available_memory() > 1e7
