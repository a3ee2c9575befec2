# SPDX-License-Identifier: Apache-2.0
"""Drag, solved exactly if the axes allow it and otherwise as a damping matrix; and full 6x6 drag matrices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.notation import reduced
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number

ZEROS = (0.0,) * 6
# Part of the exact flow -> its coefficients: their kind, and force or torque.
PARTS = {
    "linear_force": ("linear", slice(0, 3)),
    "linear_torque": ("linear", slice(3, 6)),
    "quadratic_force": ("quadratic", slice(0, 3)),
    "quadratic_torque": ("quadratic", slice(3, 6)),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Drag(Term):
    """Drag along and about each body axis: force = -(linear + quadratic |v|) v, torque likewise (Fossen 2021, section 8.1).

    v is the velocity of the user's origin along the axis, relative to the water; for the torque, v is the angular velocity.

    Args:
        linear: Linear coefficients, (6,) [N s/m, N m s], at least 0; 0 by default.
        quadratic: Quadratic coefficients, (6,) [N s2/m2, N m s2], at least 0; 0 by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> drag = lw.terms.Drag(quadratic=[2.0, 50.0, 50.0, 0.5, 20.0, 20.0])
        >>> result = lw.solve(lw.Scene.named("torpedo", start={"velocity": [1.5, 0, 0]}, terms=[drag]), h=0.05, t1=10.0)
        >>> print(f"{result.velocity[-1, 0, 0]:.2f} m/s")
        0.81 m/s
    """

    type: ClassVar[str] = "drag"
    device: ClassVar[str] = "drag_matrix"
    braking_grows_with: ClassVar[tuple[str, ...]] = ("linear", "quadratic")
    strengths: ClassVar[tuple[str, ...]] = ("linear", "quadratic")
    exact_flow: ClassVar[tuple[str, ...]] = ("drag", "drag_directions")
    pattern_device: ClassVar[str] = "drag_matrix_pattern"

    linear: Any = number((6,), "N s/m, N m s", ZEROS, least=0.0)
    quadratic: Any = number((6,), "N s2/m2, N m s2", ZEROS, least=0.0)

    def parts(self, numbers: Numbers) -> tuple[str, ...]:
        """Parts of the exact solution that some member needs.

        Args:
            numbers: The term's numbers by field, each of shape (n, 6).

        Returns:
            Names of `PARTS`: "linear_force" and so on.
        """
        return tuple(part for part, (kind, half) in PARTS.items() if np.any(numbers[kind][:, half]))

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        # Those of the diagonals.
        matrices = {kind: numbers[kind][:, :, None] * np.eye(6) for kind in ("linear", "quadratic")}
        return entry_words(l=matrices["linear"], q=matrices["quadratic"])

    def packed_exact(self, numbers: Numbers, frame: Frame, scale: np.ndarray) -> Packed:
        """The numbers for the exact solution of drag, which acts on each momentum separately.

        Args:
            numbers: The term's numbers by field, each of shape (n, 6).
            frame: The kernel's frame, whose axes are the user's up to their order (`Frame.principal`).
            scale: The factor by which the kernel divides momenta, (1,) or (n,).

        Returns:
            Linear coefficients divided by inertia [1/s], and quadratic coefficients divided by inertia squared, times
            `scale`.
        """
        inertia = {"force": np.einsum("nii->ni", frame.M), "torque": frame.J}
        values = {}
        for where, half in (("force", slice(0, 3)), ("torque", slice(3, 6))):
            linear, quadratic = (_turned(frame.Q, numbers[kind][:, half]) for kind in ("linear", "quadratic"))
            values[f"linear_{where}"] = linear / inertia[where]
            values[f"quadratic_{where}"] = quadratic * scale[:, None] / inertia[where] ** 2
        return Packed(values)

    def packed_directions(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The numbers for drag along one axis after the other, for coupled inertia.

        Args:
            numbers: The term's numbers by field, each of shape (n, 6).
            context: The scene's parameters, the frame and the run.

        Returns:
            For each axis, the column of the inverse inertia divided by its diagonal element L, and the coefficients times L.
        """
        frame = context.frame
        scale = frame.J.max(axis=1)
        inverse = np.linalg.inv(vehicle.inertia6(context.parameters))
        L = np.einsum("nii->ni", inverse)
        columns = inverse / L[:, None, :]
        values = {"turn": frame.Q, "origin": frame.forces}
        for where, half in (("force", slice(0, 3)), ("torque", slice(3, 6))):
            values[f"mass_{where}"] = 1.0 / (L[:, half] * scale[:, None])
            for kind in ("linear", "quadratic"):
                values[f"{kind}_{where}"] = numbers[kind][:, half] * L[:, half]
        for j, axis in enumerate("uvwpqr"):
            values[f"velocity_{axis}"], values[f"rate_{axis}"] = columns[:, :3, j], columns[:, 3:, j]
        return Packed(values)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The coefficients as diagonal matrices, packed as those of `DragMatrix`.
        matrices = {kind: numbers[kind][:, :, None] * np.eye(6) for kind in ("linear", "quadratic")}
        return packed_matrix(matrices["linear"], matrices["quadratic"], context)

    def per_speed(self, numbers: Numbers, speeds: np.ndarray) -> np.ndarray:
        """Drag divided by speed, along and about each axis.

        Args:
            numbers: The term's numbers by field, each of shape (n, 6).
            speeds: Sizes of velocity and angular velocity, (n, 6) [m/s, rad/s].

        Returns:
            Drag divided by speed, (n, 6) [N s/m, N m s].
        """
        return np.asarray(numbers["linear"] + numbers["quadratic"] * speeds)

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # The derivatives on the diagonal.
        diagonal = numbers["linear"] + 2.0 * numbers["quadratic"] * speeds
        return np.asarray(diagonal[:, :, None] * np.eye(6))

    def device_in(self, aligned: bool) -> str:
        # The device code of `DragMatrix`, in the form for these axes.
        return "drag_matrix" if aligned else "drag_matrix_turned"


def _turned(Q: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """The diagonal of Q^T diag Q, for axes Q that only differ in their order."""
    return np.einsum(
        "nji,nj->ni", np.broadcast_to(Q, (max(len(Q), len(diagonal)), 3, 3)) ** 2, diagonal + 0.0 * Q[:, 0]
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class DragMatrix(Term):
    """Drag by full matrices: force_i = -sum_j (linear_ij + quadratic_ij |v_j|) v_j (Fossen 2021, section 8.1).

    i runs over forces and torques, and j over velocities and angular velocities, relative to the water and about the user's
    origin.

    Args:
        linear: Linear coefficients, (6, 6) [N s/m, N s, N m s]; 0 by default.
        quadratic: Quadratic coefficients, (6, 6) [N s2/m2, N s2, N m s2]; 0 by default.

    Raises:
        SceneError: If the drag of a matrix would accelerate the vehicle at some velocity, or a number is invalid (see
            `Term`). For the quadratic matrix, the test searches by descents from the worst of 4,000 directions.
    """

    type: ClassVar[str] = "drag_matrix"
    braking_grows_with: ClassVar[tuple[str, ...]] = ("linear", "quadratic")
    strengths: ClassVar[tuple[str, ...]] = ("linear", "quadratic")
    pattern_device: ClassVar[str] = "drag_matrix_pattern"

    linear: Any = number((6, 6), "N s/m, N s, N m s", ((0.0,) * 6,) * 6)
    quadratic: Any = number((6, 6), "N s2/m2, N s2, N m s2", ((0.0,) * 6,) * 6)

    def check(self, faults: Faults) -> None:
        remedy = "drag opposes motion: positive on the diagonal (minus Fossen's X_u, X_u|u| ...), small beside it"
        for kind in ("linear", "quadratic"):
            matrix = getattr(self, kind)
            (bad,), (velocity,) = creates_energy(matrix[None], kind == "quadratic")
            if bad:
                faults.add(kind, matrix, f"creates energy at the velocity {np.round(velocity, 3).tolist()}", remedy)

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses members whose matrix creates energy.
        bad = super().unphysical(numbers)
        for kind in ("linear", "quadratic"):
            if np.array_equal(numbers[kind], getattr(self, kind)[None]):
                continue  # those of the scene, which `check` let through
            matrices = np.nan_to_num(numbers[kind]) if bad[kind].any() else numbers[kind]
            bad[kind] = bad[kind] | creates_energy(matrices, kind == "quadratic")[0]
        return bad

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        return entry_words(l=numbers["linear"], q=numbers["quadratic"])

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The matrices in the axes and about the origin of the forces.
        return packed_matrix(numbers["linear"], numbers["quadratic"], context)

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # The derivatives, column by column.
        return np.asarray(numbers["linear"] + 2.0 * numbers["quadratic"] * speeds[:, None, :])

    def device_in(self, aligned: bool) -> str:
        # The code that reads matrices directly, or for turned axes the code that first finds the user's velocities.
        return "drag_matrix" if aligned else "drag_matrix_turned"


BESIDE = ~np.eye(6, dtype=bool)


def creates_energy(matrices: np.ndarray, quadratic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Mask of drag matrices (n, 6, 6) that would accelerate a vehicle, and the worst velocity (n, 6) for each.

    The test is nu.D nu < 0, by eigenvalues for linear and by descents from the worst of many directions for quadratic ones.
    """
    bad, worst = np.zeros(len(matrices), bool), np.zeros((len(matrices), 6))
    doubtful = ~(_surely_brakes_quadratically if quadratic else _surely_brakes)(matrices)
    if np.any(doubtful):
        bad[doubtful], worst[doubtful] = _searched(matrices[doubtful], quadratic)
    return bad, worst


def _surely_brakes(matrices: np.ndarray) -> np.ndarray:
    """Mask of matrices (n, 6, 6) with nu.D nu >= 0 because the symmetric part is diagonally dominant."""
    S = np.abs(matrices + np.swapaxes(matrices, 1, 2))
    diagonal = np.einsum("nii->ni", matrices)
    return np.asarray(np.all((diagonal >= 0.0) & (4.0 * diagonal >= S.sum(axis=2)), axis=1))


def _surely_brakes_quadratically(matrices: np.ndarray) -> np.ndarray:
    """Mask of matrices (n, 6, 6) with sum_ij D_ij v_i |v_j| v_j >= 0 for every v.

    The test uses |v_i| v_j^2 <= (|v_i|^3 + 2 |v_j|^3)/3, with velocities scaled to the own drag |v_i|^3. It is sufficient,
    not necessary.
    """
    diagonal = np.einsum("nii->ni", matrices)
    brakes = (diagonal >= 0.0).all(axis=1)
    # Most matrices have few entries beside the diagonal, the same ones in all members.
    i, j = np.nonzero(matrices.any(axis=0) & BESIDE)
    if not len(i):
        return np.asarray(brakes)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        size, entries = 1.0 / np.cbrt(diagonal), matrices[:, i, j]
        scaled = np.abs(entries) * size[:, i] * size[:, j] ** 2
        shares = np.zeros((6, len(i)))
        shares[i, range(len(i))], shares[j, range(len(i))] = 1.0, 2.0
        return np.asarray(brakes & (~entries.any(axis=1) | (shares @ scaled.T <= 3.0).all(axis=0)))


def _searched(matrices: np.ndarray, quadratic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Result of `creates_energy` by search, for matrices that no inequality decides."""
    if not quadratic:
        limit = -1e-9 * np.abs(matrices).max(axis=(1, 2))
        # Divided by a power of two, which keeps all digits, lest two of the largest numbers add up to none.
        part = np.exp2(-np.frexp(np.abs(matrices).max(axis=(1, 2)))[1].astype(float))
        scaled = part[:, None, None] * matrices
        values, vectors = np.linalg.eigh(scaled + np.swapaxes(scaled, 1, 2))
        return values[:, 0] < part * limit, vectors[:, :, 0]
    directions = np.random.default_rng(0).normal(size=(4000, 6))
    directions = np.concatenate([np.eye(6), directions / np.linalg.norm(directions, axis=1, keepdims=True)])
    products = np.einsum("ki,kj->kij", directions, np.abs(directions) * directions).reshape(-1, 36)
    bad, worst = np.zeros(len(matrices), bool), np.zeros((len(matrices), 6))
    scale = _own_scale(matrices)
    scaled = matrices * scale[:, :, None] * scale[:, None, :] ** 2
    limit = -1e-9 * np.abs(scaled).max(axis=(1, 2))
    for first in range(0, len(matrices), 1024):  # 33 MB at a time
        chunk = slice(first, first + 1024)
        power = scaled[chunk].reshape(-1, 36) @ products.T
        lowest, some = directions[power.argmin(axis=1)], np.flatnonzero(power.min(axis=1) >= limit[chunk])
        bad[chunk] = True
        if len(some):
            starts = np.argpartition(power[some], STARTS, axis=1)[:, :STARTS]
            least, lowest[some] = _descended(scaled[chunk][some], directions[starts])
            bad[chunk][some] = least < limit[chunk][some]
        worst[chunk] = scale[chunk] * lowest
    return bad, worst


# Directions, the worst, from which a descent begins, and its steps.
STARTS, DESCENT = 10, 60


def _own_scale(matrices: np.ndarray) -> np.ndarray:
    """Sizes of velocities (n, 6) with own drag 1, in any units; the largest entry replaces a diagonal entry of 0."""
    diagonal = np.abs(np.einsum("nii->ni", matrices))
    most = np.maximum(np.abs(matrices).max(axis=1), np.abs(matrices).max(axis=2))
    size = np.where(diagonal > 0.0, diagonal, most)
    return np.asarray(1.0 / np.cbrt(np.where(size > 0.0, size, 1.0)))


def _descended(matrices: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least power x.D |x| x (n,) over unit vectors, found by descents from x (n, starts, 6), and its vector (n, 6)."""

    def power(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        size = np.abs(x)
        force = (size * x) @ turned
        slope = force + 2.0 * size * (x @ matrices)
        value = np.einsum("nsi,nsi->ns", x, force)
        return value, slope - 3.0 * value[..., None] * x

    turned = np.ascontiguousarray(np.swapaxes(matrices, 1, 2))
    (value, slope), step = power(x), np.full(x.shape[:2], 0.1) / np.abs(matrices).sum(axis=(1, 2))[:, None]
    for _ in range(DESCENT):
        ahead = x - step[..., None] * slope
        ahead /= np.sqrt(np.einsum("nsi,nsi->ns", ahead, ahead))[..., None]
        value_ahead, slope_ahead = power(ahead)
        lower = value_ahead < value
        x, slope = (np.where(lower[..., None], new, old) for new, old in ((ahead, x), (slope_ahead, slope)))
        value, step = np.where(lower, value_ahead, value), np.where(lower, 1.6 * step, 0.4 * step)
    best, every = value.argmin(axis=1), np.arange(len(x))
    return value[every, best], x[every, best]


def entry_words(**matrices: np.ndarray) -> tuple[str, ...]:
    """The entries that are not zero for some member, as words such as "q01"; matrices (n, 6, 6) are named by a letter."""
    found = {letter: np.argwhere((matrix != 0.0).any(axis=0)) for letter, matrix in matrices.items()}
    return tuple(f"{letter}{i}{j}" for letter, places in found.items() for i, j in places.tolist())


def packed_matrix(linear: np.ndarray, quadratic: np.ndarray, context: PackingContext) -> Packed:
    """Device rows of drag matrices (n, 6, 6), user's axes and origin: the linear matrix, then the quadratic one.

    If the kernel's axes are rotated, the quadratic part has two entries for each nonzero column: the twist (6), which
    measures the velocity, and the wrench (6).
    """
    # X gives the user's velocities from those at the origin of the forces in the kernel's axes.
    X = context.frame.from_forces
    XT = np.swapaxes(X, 1, 2)
    columns: dict[int, list[int]] = {}
    for j, i in np.argwhere(reduced(np.logical_or, quadratic).T).tolist():
        columns.setdefault(j, []).append(i)
    constant = (XT @ linear @ X).reshape(-1, 36)
    values = {"constant": int(linear.any())}
    if context.aligned:
        rows = (constant, (XT @ quadratic @ X).reshape(-1, 36))
        return Packed(values | {"quadratic": int(bool(columns))}, rows)
    parts = [constant]
    for j, entries in columns.items():
        # X^T q of a column q, whose entries are mostly zero; members side by side, which is twice as fast.
        wrench = sum(X[:, i, :].T * quadratic[:, i, j] for i in entries)
        parts += [X[:, j, :], np.asarray(wrench).T]
    return Packed(values | {"count": len(columns)}, tuple(parts))
