# SPDX-License-Identifier: Apache-2.0
"""The inertia of a vehicle about the origins and in the axes that a method requires.

I6 = [[M, C], [C^T, J]], linear part first. E = M^-1 C, Js = J - C^T M^-1 C. Arrays have a leading dimension of 1 (shared by
all members) or n. A shift of the origin by d (body axes) leaves M and Js unchanged and adds hat(d) to E.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lgvi_warp.physics import notation
from lgvi_warp.physics.notation import hat

# A coupling below this fraction of its possible size is round-off of turned axes and shifted origins.
ROUND_OFF = 1e-12
# Off-diagonal elements below this fraction of the largest are round-off of the turned axes.
DIAGONAL = 1e-12


def vee(A: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of the skew-symmetric part of matrices (..., 3, 3); the inverse of `hat`."""
    return 0.5 * np.stack([A[..., i, j] - A[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1)


class Blocks(NamedTuple):
    """Blocks of mass matrices: mass M [kg], coupling C [kg m], inertia J [kg m2], (., 3, 3), each with 1 or n members."""

    M: np.ndarray
    C: np.ndarray
    J: np.ndarray


def blocks(I6: np.ndarray) -> Blocks:
    """The blocks M, C and J of mass matrices (n, 6, 6), linear part first."""
    return Blocks(I6[:, :3, :3], I6[:, :3, 3:], I6[:, 3:, 3:])


def joined(M: np.ndarray, C: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Mass matrices (n, 6, 6), linear part first, from their blocks M [kg], C [kg m] and J [kg m2], (n, 3, 3) each."""
    I6 = np.empty((max(len(M), len(C), len(J)), 6, 6))
    I6[:, :3, :3], I6[:, :3, 3:], I6[:, 3:, :3], I6[:, 3:, 3:] = M, C, np.swapaxes(C, -1, -2), J
    return I6


def motion_from(origin: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Matrices X (n, 6, 6) that convert (nu, Om) at another origin and in axes Q to the user's origin and axes.

    origin: (n, 3) [m], relative to the user's origin, in the user's axes. Q: (n, 3, 3), the other axes in the user's axes.
    """
    X = np.zeros((max(len(Q), len(origin)), 6, 6))
    X[:, :3, :3] = X[:, 3:, 3:] = Q + 0.0  # without negative zeros
    X[:, :3, 3:] = hat(origin) @ Q
    return X


def moved(I6: np.ndarray, origin: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Mass matrices (n, 6, 6) about another origin and in other axes.

    I6: (n, 6, 6) about the user's origin, in the user's axes. origin: (n, 3) [m]. Q: (n, 3, 3). Both as in `motion_from`.
    """
    X = motion_from(origin, Q)
    return np.swapaxes(X, -1, -2) @ I6 @ X


def coupling(I6: np.ndarray) -> np.ndarray:
    """The coupling norm (n,) of mass matrices (n, 6, 6), from 0 to 1: the largest singular value of M^-1/2 C J^-1/2.

    docs/theory/coupled.md, (X6).

    It is infinite if round-off or overflow makes the matrix not positive definite.
    """
    M, C, J = blocks(I6)
    try:
        Lm, Lj = np.linalg.cholesky(M), np.linalg.cholesky(J)
        scaled = np.linalg.solve(Lm, C) @ np.linalg.inv(np.swapaxes(Lj, -1, -2))
    except np.linalg.LinAlgError:
        return np.full(len(I6), np.inf)
    finite = np.asarray(np.isfinite(scaled).all(axis=(-2, -1)))
    norms = np.linalg.norm(np.where(finite[:, None, None], scaled, 0.0), ord=2, axis=(-2, -1))
    return np.where(finite, norms, np.inf)


@dataclass(frozen=True)
class Frame:
    """The axes and origins of a vehicle in the kernel. Leading dimensions are 1 or n.

    origin, forces: Origins of the state and of the forces, (., 3) [m], relative to the user's origin, in the user's axes.
    M, J: Mass matrix (., 3, 3) [kg] and diagonal (Schur) inertia (., 3) [kg m2] in the axes Q.
    E, E_forces: M^-1 C at the origin of the state and at that of the forces, (., 3, 3) [m]; 0 without coupling.
    whole: The 6x6 inertia (n, 6, 6) in the user's axes, if M and J are not diagonal there or are coupled. J then holds the
        principal moments about `center`, the origin with the least coupling, (n, 3) [m].
    """

    Q: np.ndarray
    origin: np.ndarray
    forces: np.ndarray
    M: np.ndarray
    J: np.ndarray
    E: np.ndarray
    E_forces: np.ndarray
    whole: np.ndarray | None = None
    center: np.ndarray | None = None

    @functools.cached_property
    def turned(self) -> bool:
        """Whether some member's axes differ from the user's axes."""
        return bool((notation.EYE != self.Q).any())

    @functools.cached_property
    def shifted(self) -> bool:
        """Whether some member's origin of the state differs from the user's origin."""
        return bool(self.origin.any())

    def with_mass(self, M: np.ndarray) -> Frame:
        """The same axes and origins with other mass matrices (n, 3, 3) [kg]."""
        frame = replace(self, M=M)
        vars(frame).update(turned=self.turned, shifted=self.shifted)
        return frame

    @functools.cached_property
    def mass_diagonal(self) -> np.ndarray | None:
        """Diagonals (., 3) of the mass matrices if all are diagonal; else None."""
        return notation.only_diagonal(self.M)

    @property
    def principal(self) -> bool:
        """Whether the user's axes are principal axes of M and J, in any order, about the same origin."""
        off = np.abs(self.M[:, ~np.eye(3, dtype=bool)]).max(axis=1)
        diagonal = off <= DIAGONAL * np.abs(np.einsum("nii->ni", self.M)).max(axis=1)
        return bool(np.all(diagonal) and self.aligned and not self.coupled and self.whole is None)

    @functools.cached_property
    def from_forces(self) -> np.ndarray:
        """Matrices (., 6, 6) from velocities at the origin of the forces, in these axes, to the user's velocities."""
        return motion_from(self.forces, self.Q)

    @property
    def balance(self) -> np.ndarray:
        """The origin about which weight and buoyancy swing the vehicle, (., 3) [m]: the one with the least coupling."""
        return self.forces if self.center is None else self.center

    @functools.cached_property
    def inverse(self) -> np.ndarray:
        """The inverse (n, 6, 6) of the 6x6 inertia."""
        return np.asarray(np.linalg.inv(self.inertia_at(self.E) if self.whole is None else self.whole))

    @property
    def aligned(self) -> bool:
        """Whether all members have the user's axes, up to order and sign, and the user's origin for the forces."""
        Q = np.abs(self.Q)
        return bool(np.all((Q == 0.0) | (Q == 1.0)) and not np.any(self.forces))

    @property
    def coupled(self) -> bool:
        """Whether linear and angular velocities of some member are coupled at either origin."""
        return bool(np.any(self.E) or np.any(self.E_forces))

    def inertia_at(self, E: np.ndarray) -> np.ndarray:
        """Mass matrix (n, 6, 6) in these axes at the origin with M^-1 C = E (n, 3, 3) [m]; there J = Js + E^T M E."""
        if self.whole is not None:
            return self.whole
        J = self.J[:, :, None] * notation.EYE
        return joined(self.M + 0.0 * E, self.M @ E, J + np.swapaxes(E, -1, -2) @ self.M @ E)

    def vector(self, v: np.ndarray) -> np.ndarray:
        """Components of body vectors in these axes."""
        return np.einsum("nji,n...j->n...i", *notation.repeated(self.Q, v))

    def point(self, r: np.ndarray) -> np.ndarray:
        """Convert points (n, ..., 3) [m] in the user's frame to these axes, relative to the origin of the forces."""
        return self.vector(r - _expanded(self.forces, r))

    def torque(self, torque: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Convert torques (n, ..., 3) [N m] of wrenches with these forces from the user's origin to that of the forces.

        The angular part of a twist that measures a velocity transforms in the same way.
        """
        arm, torque, force = np.broadcast_arrays(_expanded(self.forces, force), torque, force)
        return self.vector(torque - notation.cross(arm, force))


def _expanded(origin: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Origins (n, 3) with the number of dimensions of (n, ..., 3)."""
    return origin.reshape(len(origin), *(1,) * (like.ndim - 2), 3)


def schur(body: Blocks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass M [kg], E = M^-1 C [m] and the Schur complement Js = J - C^T E [kg m2] of mass matrices, (., 3, 3) each."""
    coupled = np.any(body.C, axis=(-2, -1))
    if not coupled.any():
        return body.M, np.zeros_like(body.C), body.J
    M, C, J = notation.repeated(*body)
    coupled = np.broadcast_to(coupled, len(C))
    E, Js = np.zeros_like(C), J.copy()
    E[coupled] = np.linalg.solve(M[coupled], C[coupled])
    Js[coupled] -= np.swapaxes(C[coupled], -1, -2) @ E[coupled]
    return M, E, Js


def in_axes(Q: np.ndarray, A: np.ndarray) -> np.ndarray:
    """Matrices in other axes, Q^T A Q."""
    if np.all(notation.EYE == Q):
        return A
    return np.asarray(np.swapaxes(Q, -1, -2) @ A @ Q)


def uncoupled_frame(body: Blocks) -> tuple[Frame, np.ndarray]:
    """The frame with diagonal J at the origin of least coupling, and the coupling norm (n,) that remains there.

    The coupling vanishes there if and only if E is skew-symmetric.
    """
    M, E, Js = schur(body)
    origin = -vee(E)
    Q, J = notation.principal_axes(Js)
    coupled, remaining = np.any(E, axis=(-2, -1)), np.zeros(len(E))
    if coupled.any():
        remaining[coupled] = coupling(moved(joined(*body)[coupled], origin[coupled], Q[coupled]))
    zero = np.zeros_like(E)
    # Mass does not depend on the origin.
    return Frame(Q, origin, origin, in_axes(Q, M), J, zero, zero), remaining


def user_frame(body: Blocks) -> Frame:
    """The frame of the user's axes and origin. Entries below round-off count as zero."""
    M, E, Js = schur(body)
    _, J = notation.principal_axes(Js)
    n, zero = len(E), np.zeros((1, 3))
    whole = joined(*body)
    size = np.sqrt(np.einsum("nii->ni", whole))
    beside = ~np.eye(6, dtype=bool)
    if not np.any((np.abs(whole) > DIAGONAL * size[:, :, None] * size[:, None, :])[:, beside]):
        return Frame(np.eye(3)[None], zero, zero, M, J, np.zeros_like(E), np.zeros_like(E))
    return Frame(np.eye(3)[None], zero, zero, M, J, E, E, whole, np.broadcast_to(-vee(E), (n, 3)))


def user_frame_with_mass(frame: Frame, M: np.ndarray, J: np.ndarray) -> Frame:
    """The frame of the user's axes for another mass matrix (n, 3, 3) [kg]. J: The inertia (n, 3, 3) of the frame."""
    if frame.whole is None and not notation.off_diagonal(M).any():
        return replace(frame, M=M)
    n = max(len(M), len(J))
    return replace(frame, M=M, whole=joined(M, np.zeros((n, 3, 3)), J), center=np.zeros((n, 3)))


def ascending(Q: np.ndarray, J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Right-handed principal axes (n, 3, 3) and inertias (n, 3) [kg m2] in the order of rising inertia."""
    order = np.argsort(J, axis=1, kind="stable")
    Q = np.take_along_axis(Q, order[:, None, :], axis=2)
    Q = Q * np.where(np.arange(3) == 2, np.sign(np.linalg.det(Q))[:, None], 1.0)[:, None, :]
    return Q, np.take_along_axis(J, order, axis=1)


def nearest_axes(Q: np.ndarray, like: np.ndarray, ordered: bool) -> np.ndarray:
    """Matrices P (n, 3, 3) that change order and signs of axes Q, so that Q P is nearest to the axes `like` (n, 3, 3).

    P is the identity if there is no such matrix. ordered: Whether the order of the axes must stay.
    """
    between = np.swapaxes(Q, -1, -2) @ like
    largest = np.abs(between).argmax(axis=1)
    P = np.zeros_like(between)
    np.put_along_axis(P, largest[:, None], np.sign(np.take_along_axis(between, largest[:, None], axis=1)), axis=1)
    proper = np.abs(np.linalg.det(P) - 1.0) < ROUND_OFF
    if ordered:
        proper &= ~notation.off_diagonal(P).any(axis=1)
    return np.where(proper[:, None, None], P, notation.EYE)


def in_order(frame: Frame, P: np.ndarray) -> Frame:
    """The same frame with its axes in another order and with other signs; P: As in `nearest_axes`."""
    order = np.abs(P).argmax(axis=1)
    M, E, E_forces = (in_axes(P, each) if each.any() else each for each in (frame.M, frame.E, frame.E_forces))
    return replace(frame, Q=frame.Q @ P, J=np.take_along_axis(frame.J, order, axis=1), M=M, E=E, E_forces=E_forces)


def turns_frame(body: Blocks, middle: int = 3) -> tuple[Frame, np.ndarray]:
    """The frame of psi_x, with the state at the origin of axis 1 and the forces at the origin of axis `middle`.

    Returns: The frame, and the upper triangular U (n, 3, 3) [m], which is E at the origin of the state.
    """
    M, E, Js = schur(body)
    Q, J = ascending(*notation.principal_axes(Js))
    EQ = in_axes(Q, E)
    size = np.abs(EQ).max(axis=(-2, -1), keepdims=True)
    d = np.stack([-EQ[:, 2, 1], EQ[:, 2, 0], -EQ[:, 1, 0]], axis=-1)
    U = np.triu(EQ + hat(d))
    U = np.where(np.abs(U) > ROUND_OFF * size, U, 0.0)
    a = np.stack([U[:, 1, 2], -U[:, 0, 2], U[:, 0, 1]], axis=-1)
    if middle == 2:
        a[:, :2] = 0.0
    M = in_axes(Q, M)
    return Frame(Q, notation.rotate_out(Q, d), notation.rotate_out(Q, d + a), M, J, U, U + hat(a)), U


def symmetric_frame(body: Blocks) -> Frame:
    """The frame of psi_w, at the origin with a symmetric E = S, in the principal axes of Js."""
    M, E, Js = schur(body)
    origin = -vee(E)
    Q, J = notation.principal_axes(Js)
    S = in_axes(Q, 0.5 * (E + np.swapaxes(E, -1, -2)))
    return Frame(Q, origin, origin, in_axes(Q, M), J, S, S)
