"""Axes of contact pairs, and rigid motions of an interface: what slides freely, what nothing prevents."""

from dataclasses import replace

import numpy as np
import pytest
from interfaces import bare_interface

from gibiane_ops.kernels.contact.balance import kind_of_motion
from gibiane_ops.kernels.contact.drift import without_drift
from gibiane_ops.kernels.contact.frames import local_frames

SLIDE = np.array([0.0, 1.0, 0.0, 1.0]) / np.sqrt(2)
LIFT = np.array([1.0, 0.0, 1.0, 0.0]) / np.sqrt(2)


def free(*motions: np.ndarray):
    return replace(bare_interface(np.eye(4), np.zeros(4), 2), rigid=np.stack(motions, axis=1))


@pytest.mark.parametrize(
    "interface",
    [free(SLIDE, LIFT), free((SLIDE + LIFT) / np.sqrt(2), (SLIDE - LIFT) / np.sqrt(2))],
    ids=["pure", "mixed"],
)
def test_only_motions_along_the_surface_are_drift(interface) -> None:
    w = np.array([[0.5, 3.0], [0.7, 5.0]])
    assert without_drift(w, interface) == pytest.approx(np.array([[0.5, -1.0], [0.7, 1.0]]))


def test_a_motion_that_changes_a_gap_a_little_is_no_drift() -> None:
    wedge = np.array([0.05, 1.0, 0.05, 1.0])
    w = np.array([[0.5, 3.0], [0.7, 5.0]])
    assert without_drift(w, free(wedge / np.linalg.norm(wedge))) == pytest.approx(w)
    assert without_drift(w, bare_interface(np.eye(4), np.zeros(4), 2)) is w


@pytest.mark.parametrize(
    ("motion", "kind"),
    [
        ([[0.0, 1.0], [0.0, 1.0]], "sliding"),
        ([[-0.3, 1.0], [-0.3, 1.0]], "sliding"),  # the opening mu w_t of the polar cone
        ([[-1.0, 0.0], [-1.0, 0.0]], "separation"),
        ([[-0.9, 1.0], [-0.9, 1.0]], "separation"),
        ([[-1.0, 0.2], [0.0, 0.2]], "tipping"),
    ],
)
def test_kinds_of_motion(motion, kind) -> None:
    assert kind_of_motion(np.array(motion), np.full(2, 0.3)) == kind


@pytest.mark.parametrize(
    ("normal", "first"),
    [([0, 0, 1], [1, 0, 0]), ([0, 1, 0], [-1, 0, 0]), ([1, 0, 0], [0, 0, -1]), ([0.1, 0.05, 0.99], [0.99, 0, -0.1])],
)
def test_tangents_without_supports(normal, first) -> None:
    """The first is x where the normal is z; neighbours on a surface that turns little have the like."""
    n = np.array([normal]) / np.linalg.norm(normal)
    frames, active, shortening = local_frames(n, np.full((1, 3), True))
    t1 = np.array(first) / np.linalg.norm(first)
    assert frames[0] == pytest.approx(np.stack([n[0], t1, np.cross(n[0], t1)]))
    assert active.all()
    assert shortening == pytest.approx([1.0])
