"""Drag: by its exact flow where the axes allow it, else as a damping matrix; and full 6x6 drag matrices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.inertia import Frame, motion_from
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, quantity

ZEROS = (0.0,) * 6
# Off-diagonal elements below this fraction of the largest are the round-off of turning the axes.
DIAGONAL = 1e-12
# Part of the exact flow -> the coefficients that it is of.
PARTS = {
    "linear_force": ("linear", slice(0, 3)),
    "linear_torque": ("linear", slice(3, 6)),
    "quadratic_force": ("quadratic", slice(0, 3)),
    "quadratic_torque": ("quadratic", slice(3, 6)),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Drag(Term):
    """Per axis: force = -(linear + quadratic |v|) v, torque likewise (Fossen 2021, 8.1).

    linear: (6,) [N s/m, N m s]; quadratic: (6,) [N s2/m2, N m s2]; none negative. Velocities are relative to the water.
    """

    type: ClassVar[str] = "drag"
    device: ClassVar[str] = "drag_matrix"

    linear: Any = quantity((6,), "N s/m, N m s", ZEROS, least=0.0)
    quadratic: Any = quantity((6,), "N s2/m2, N m s2", ZEROS, least=0.0)

    def present(self, own: Numbers) -> bool:
        """Whether some coefficient is not zero."""
        return bool(np.any(own["linear"]) or np.any(own["quadratic"]))

    def parts(self, own: Numbers) -> tuple[str, ...]:
        """Which parts of the exact flow some member has."""
        return tuple(part for part, (kind, half) in PARTS.items() if np.any(own[kind][:, half]))

    def packed_exact(self, own: Numbers, frame: Frame, scale: np.ndarray) -> Packed:
        """For the exact flow: l / I [1/s], and q / I per momentum, which is kept divided by scale (1 or n,)."""
        inertia = {"force": np.einsum("nii->ni", frame.M), "torque": frame.J}
        values = {}
        for where, half in (("force", slice(0, 3)), ("torque", slice(3, 6))):
            linear, quadratic = (_turned(frame.Q, own[kind][:, half]) for kind in ("linear", "quadratic"))
            values[f"linear_{where}"] = linear / inertia[where]
            values[f"quadratic_{where}"] = quadratic * scale[:, None] / inertia[where] ** 2
        return Packed(values)

    def packed_directions(self, own: Numbers, setting: Setting) -> Packed:
        """For one axis after the other: the columns of the inverse inertia, each divided by its diagonal element L."""
        frame = setting.frame
        scale = frame.J.max(axis=1)
        inverse = np.linalg.inv(vehicle.inertia6(setting.parameters))
        L = np.einsum("nii->ni", inverse)
        columns = inverse / L[:, None, :]
        values = {"turn": frame.Q, "origin": frame.forces}
        for where, half in (("force", slice(0, 3)), ("torque", slice(3, 6))):
            values[f"mass_{where}"] = 1.0 / (L[:, half] * scale[:, None])
            for kind in ("linear", "quadratic"):
                values[f"{kind}_{where}"] = own[kind][:, half] * L[:, half]
        for j, axis in enumerate("uvwpqr"):
            values[f"velocity_{axis}"], values[f"rate_{axis}"] = columns[:, :3, j], columns[:, 3:, j]
        return Packed(values)

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """As the matrix that it is the diagonal of."""
        matrices = {kind: own[kind][:, :, None] * np.eye(6) for kind in ("linear", "quadratic")}
        return packed_matrix(matrices["linear"], matrices["quadratic"], setting)

    def device_in(self, aligned: bool) -> str:
        """As of the matrix."""
        return "drag_matrix" if aligned else "drag_matrix_turned"


def _turned(Q: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """The diagonal of Q^T diag Q, for axes that are the same but for their order."""
    return np.einsum(
        "nji,nj->ni", np.broadcast_to(Q, (max(len(Q), len(diagonal)), 3, 3)) ** 2, diagonal + 0.0 * Q[:, 0]
    )


def has_exact_flow(frame: Frame) -> bool:
    """Whether the user's axes are principal axes of M and J, in any order, about the same origin."""
    M = frame.M
    off = np.abs(M[:, ~np.eye(3, dtype=bool)]).max(axis=1)
    diagonal = off <= DIAGONAL * np.abs(np.einsum("nii->ni", M)).max(axis=1)
    return bool(np.all(diagonal) and frame.aligned and not frame.coupled)


@dataclass(frozen=True, eq=False, kw_only=True)
class DragMatrix(Term):
    """force_i = -sum_j (linear_ij + quadratic_ij |v_j|) v_j, forces and torques, velocities and rates (Fossen 2021, 8.1).

    linear: (6, 6) [N s/m, N s, N m s]; quadratic: (6, 6) [N s2/m2 and so on]. Refused if they create energy: the
    symmetric part of the linear matrix must not be negative, nor that of the quadratic at any velocity tried.
    """

    type: ClassVar[str] = "drag_matrix"
    device: ClassVar[str] = "drag_matrix"

    linear: Any = quantity((6, 6), "N s/m, N s, N m s", ((0.0,) * 6,) * 6)
    quadratic: Any = quantity((6, 6), "N s2/m2, N s2, N m s2", ((0.0,) * 6,) * 6)

    def check(self, faults: Faults) -> None:
        """Drag must not create energy."""
        remedy = "drag opposes motion: positive on the diagonal (minus Fossen's X_u, X_u|u| ...), small beside it"
        for kind in ("linear", "quadratic"):
            matrix = getattr(self, kind)
            (bad,), (velocity,) = _creates_energy(matrix[None], kind == "quadratic")
            if bad:
                faults.add(kind, matrix, f"creates energy at the velocity {np.round(velocity, 3).tolist()}", remedy)

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """Also where a member's matrix creates energy."""
        bad = super().unphysical(own)
        for kind in ("linear", "quadratic"):
            bad[kind] = bad[kind] | _creates_energy(np.nan_to_num(own[kind]), kind == "quadratic")[0]
        return bad

    def present(self, own: Numbers) -> bool:
        """Whether some coefficient is not zero."""
        return bool(np.any(own["linear"]) or np.any(own["quadratic"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """In the axes and about the origin of the forces."""
        return packed_matrix(own["linear"], own["quadratic"], setting)

    def device_in(self, aligned: bool) -> str:
        """Where the axes are not the kernel's, velocities along them are to be found first."""
        return "drag_matrix" if aligned else "drag_matrix_turned"


def _creates_energy(matrices: np.ndarray, quadratic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Which of the matrices (n, 6, 6) would speed a vehicle up, and the worst velocity (n, 6) for each.

    nu.D nu for linear matrices by their eigenvalues; for quadratic ones, nu.D(|nu|) nu at 4,000 fixed directions.
    """
    limit = -1e-9 * np.abs(matrices).max(axis=(1, 2))
    if not quadratic:
        values, vectors = np.linalg.eigh(matrices + np.swapaxes(matrices, 1, 2))
        return values[:, 0] < limit, vectors[:, :, 0]
    directions = np.random.default_rng(0).normal(size=(4000, 6))
    directions = np.concatenate([np.eye(6), directions / np.abs(directions).max(axis=1, keepdims=True)])
    products = np.einsum("ki,kj->kij", directions, np.abs(directions) * directions).reshape(-1, 36)
    bad, worst = np.zeros(len(matrices), bool), np.zeros((len(matrices), 6))
    for first in range(0, len(matrices), 1024):  # 33 MB at a time
        part = slice(first, first + 1024)
        power = products @ matrices[part].reshape(-1, 36).T
        lowest = power.argmin(axis=0)
        bad[part], worst[part] = power.min(axis=0) < limit[part], directions[lowest]
    return bad, worst


def packed_matrix(linear: np.ndarray, quadratic: np.ndarray, setting: Setting) -> Packed:
    """Rows: the linear matrix, then the quadratic one.

    Or, where the axes are not the kernel's, for each velocity that has a quadratic column its twist (6) and its wrench (6).
    """
    # The user's velocities from those at the origin of the forces in the kernel's axes.
    X = motion_from(setting.frame.forces, setting.frame.Q)
    n = max(len(linear), len(quadratic), len(X))
    X = np.broadcast_to(X, (n, 6, 6))
    XT = np.swapaxes(X, 1, 2)
    values = {"constant": int(np.any(linear))}
    rows = [(XT @ linear @ X).reshape(n, 36)]
    if setting.aligned:
        rows.append((XT @ quadratic @ X).reshape(n, 36))
        return Packed(values | {"quadratic": int(np.any(quadratic))}, np.concatenate(rows, axis=1))
    columns = [j for j in range(6) if np.any(quadratic[:, :, j])]
    for j in columns:
        rows += [X[:, j, :], np.einsum("nij,nj->ni", XT, np.broadcast_to(quadratic[:, :, j], (n, 6)))]
    return Packed(values | {"count": len(columns)}, np.concatenate(rows, axis=1))
