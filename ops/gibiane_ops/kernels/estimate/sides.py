"""Linear tractions on the sides of simplices that have the moments of those given on facets of elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gibiane_ops.kernels import quadrature
from gibiane_ops.kernels.arrays import FloatArray, IntArray
from gibiane_ops.kernels.elements.shape import Shape
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.estimate.fields import located
from gibiane_ops.kernels.estimate.macro import contraction, moments

STRAIGHT = 1e-9
"""Largest distance of a node to the line or plane of its facet, over the size of the facet, that is none."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Sides of simplices and the facets that they are parts of, (k,) of each.

    Attributes
    ----------
    of : Shape
        Of the facets.
    X : (k, n_nodes, d) float64, length
        Nodes of the facets.
    at : (k, d, d - 1) float64
        Corners of the sides in reference coordinates of the facets.
    corners : (k, d, d) float64, length
        These corners.
    """

    of: Shape
    X: FloatArray
    at: FloatArray
    corners: FloatArray

    def linear(
        self,
        traction: FloatArray,
        stress: Callable[[IntArray, FloatArray], FloatArray] | None = None,
        bare: FloatArray | None = None,
        pressure: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the linear tractions of the same moments.

        Parameters
        ----------
        traction : (k, n_nodes, d) float64, force / length^(d - 1)
            At the nodes of the facets.
        stress : callable, optional
            ``stress(rows, xi)``, (m, q, n_s): that at points of facets, in their reference coordinates. With it, chords
            of curved facets also carry what it does by their tilt, ``s (n_chord - n)``, whose resultant is about zero:
            without, the tractions of a smooth stress would be wrong by the tilt, and the error of a fine mesh of
            quadratic elements less than that.
        bare : (k, n_nodes, d) float64, optional
            Tractions without those of the pressure.
        pressure : (k, n_nodes) float64, optional
            It follows the bends of curved facets.

        Returns
        -------
        given : (k, d, d) float64, force / length^(d - 1)
            At the corners of the sides. They have the resultant of those of the facets, on chords of curved ones too.
        left : (k,) float64
            Largest difference to those given.
        """
        dim = self.X.shape[2]
        rule, inside = self._rule()
        area = self.areas()
        xi, density = inside @ self.at, np.broadcast_to(area[:, None], (len(area), len(rule.weights))).copy()
        bent = self.bent()
        flat = np.setdiff1d(np.arange(len(area)), bent)
        xi[flat] = located(self.of, self.X[flat], inside @ self.corners[flat], xi[flat])
        normal = np.zeros((0, 1, dim))
        if len(bent):
            normal, _ = self._normals(bent)
            density[bent] = np.linalg.norm(normal, axis=2) * rule.weights.sum()
        N = self.of.N(xi.reshape(-1, dim - 1)).reshape(*xi.shape[:2], -1)
        values = np.matmul(N, traction)
        if len(bent) and bare is not None and pressure is not None:
            normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
            push = np.matmul(N[bent], pressure[bent, :, None])
            values[bent] = np.matmul(N[bent], bare[bent]) - push * normal
        weight = rule.weights / rule.weights.sum()
        moment = np.einsum("q,kq,qa,kqi->kai", weight, density, inside, values, optimize=True)
        if len(bent) and stress is not None:
            normal, chord = self._normals(bent)
            tilt = np.matmul(contraction(chord - normal, dim), stress(bent, xi[bent])[..., None])[..., 0]
            moment[bent] += np.einsum("q,qa,kqi->kai", rule.weights, inside, tilt)
        given = np.einsum("ab,kbi->kai", np.linalg.inv(moments(dim)), moment) / area[:, None, None]
        return given, np.abs(inside @ given - values).max(axis=(1, 2), initial=0.0)

    def moments(self, traction: FloatArray) -> FloatArray:
        """Return ``int t N_a`` at the corners of the sides, (k, d, d), from tractions at the nodes of the facets."""
        given, _ = self.linear(traction)
        return np.asarray(np.einsum("k,ab,kbi->kai", self.areas(), moments(self.X.shape[2]), given), np.float64)

    def areas(self) -> FloatArray:
        """Return the measures of the sides, (k,)."""
        along = self.corners[:, 1:] - self.corners[:, :1]
        square = np.linalg.det(np.matmul(along, along.swapaxes(1, 2)))
        return np.asarray(np.sqrt(square) / (self.X.shape[2] - 1), np.float64)

    def bent(self) -> IntArray:
        """Return the sides of facets that are not straight or plane."""
        arm = self.X - self.X[:, :1]
        size = np.abs(arm).max(axis=(1, 2))
        first = self.corners[:, 1:] - self.corners[:, :1]
        if self.X.shape[2] == 2:
            normal = np.stack([first[:, 0, 1], -first[:, 0, 0]], axis=1)
        else:
            normal = np.cross(first[:, 0], first[:, 1])
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        off = np.abs(np.einsum("kni,ki->kn", self.X - self.corners[:, :1], normal)).max(axis=1)
        return np.flatnonzero(off > STRAIGHT * size)

    def _rule(self) -> tuple[quadrature.Rule, FloatArray]:
        """Return a rule on the sides, and the barycentric coordinates of its points."""
        if self.X.shape[2] == 2:
            rule = quadrature.line(4)
            return rule, shape("SEG2").N(rule.points)
        rule = quadrature.simplex(2, 4)
        return rule, shape("TRI3").N(rule.points)

    def _normals(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return outward normals of facets at the points of the rule, and of sides, (m, q, d), times the measures."""
        dim = self.X.shape[2]
        _, inside = self._rule()
        xi = inside @ self.at[rows]
        slope = self.of.dN(xi.reshape(-1, dim - 1)).reshape(*xi.shape[:2], -1, dim - 1)
        part = shape("SEG2" if dim == 2 else "TRI3").dN(np.zeros((1, dim - 1)))[0]
        along = np.einsum("kni,kqnj,kaj,am->kqim", self.X[rows], slope, self.at[rows], part, optimize=True)
        chord = np.broadcast_to(np.einsum("kai,am->kim", self.corners[rows], part)[:, None], along.shape)
        turn = np.sign(np.linalg.det(np.einsum("kaj,am->kjm", self.at[rows], part)))[:, None, None]
        return turn * _normal(along), turn * _normal(chord)


def _normal(along: FloatArray) -> FloatArray:
    """Return the normal of tangents, (m, q, d, d - 1)."""
    if along.shape[2] == 2:
        return np.stack([along[..., 1, 0], -along[..., 0, 0]], axis=-1)
    return np.cross(along[..., 0], along[..., 1])
