# SPDX-License-Identifier: Apache-2.0
"""Warnings about the step: those that the kernel checks, their limits, and those at a member's start."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from lgvi_warp.common.status import Warnings
from lgvi_warp.engine.kernel_choice import resists
from lgvi_warp.methods.limits import MUNK, RESTORING, longest_stage, oscillation_limit, rotation_limit
from lgvi_warp.methods.method import KINDS, Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics import hydrostatics, notation, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import Numbers, Term, own

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members


class Watched(Protocol):
    """The attributes of a plan that warnings need; `Plan` has them."""

    @property
    def method(self) -> Method:
        """The integration method of the run."""

    @property
    def grid(self) -> TimeGrid:
        """The steps and the sample times."""

    @property
    def dtype(self) -> str:
        """The kernel's number type, such as "float64"."""

    @property
    def kernel_choice(self) -> Any:
        """The laws that act and the method's program (see `KernelChoice`)."""

    @property
    def spec(self) -> Any:
        """Everything that determines the kernel's source (see `Spec`)."""


# h w above which an oscillation is coarsely resolved, h being the length of the longest stage [1].
COARSE = 0.5


# Largest drag number h (l + 2 q|v|) / I of drag that is treated explicitly [1].
DRAG_NUMBER = 1.0


# The same of drag by its exact flow, or implicitly: at 3 a splitting has order 1.8, at 8 it has 1.3 to 1.7, at 80 0.9.
SPLIT_DRAG_NUMBER = 5.0


# Largest spacing of floating-point numbers at the position, as a fraction of the distance covered in a step [1].
PRECISION = 0.05


# Largest |R^T R - I|, by dtype [1].
ORTHOGONAL = {"float64": 1e-10, "float32": 1e-4}


# The same for methods whose R departs from a rotation by their own truncation error.
ORTHOGONAL_TO_ERROR = 1e-3


# Largest energy gained, as a fraction of the energy available for exchange [1].
ENERGY = 0.5


def watched(method: Method, choice: Any, dtype: str, checks: str) -> tuple[str, ...]:
    """Warnings that the kernel checks, as names of rows of lgvi_kernels.advance.monitor, the least serious first.

    With checks="all": all that are possible with method and scene. With "safe": the attitude, if the method can let it
    drift.
    """
    if checks != "all":
        return ("orthogonality",) * (checks == "safe" and leaves_rotations(method))
    rows = ["precision"] * (dtype == "float32") + ["orthogonality"]
    if not method.adaptive:
        munk = choice.mass != "isotropic"
        rows += ["munk_coarse"] * munk
        rows += ["rotation"] * (method.turns or method.tableau is not None)
        rows += ["drag"] * (_dragged(choice) and not method.linearly_implicit)
        rows += ["munk_unstable"] * munk
    return (*rows, *["energy"] * choice.conservative)


def _dragged(choice: Any) -> bool:
    """Whether a law reduces the speed of the vehicle."""
    return bool(choice.drag) or any(resists(module) for _, module in choice.laws)


def _split(plan: Watched) -> bool:
    """Whether the method applies drag by its own sub-map, exact or implicit, separate from the motion."""
    return plan.method.tableau is None and plan.kernel_choice.averages is None


@np.errstate(over="ignore", invalid="ignore")
def _drag_number(plan: Watched, members: Members, water: np.ndarray | None) -> np.ndarray:
    """h (l + 2 q|v|) / I, (m,), the largest of all axes, at the members' starts, for terms whose damping is known."""
    p, velocity = members.parameters, members.velocity if water is None else members.velocity - water
    twist = np.concatenate(np.broadcast_arrays(velocity, members.angular_velocity), axis=1)
    total = np.zeros((1, 6))
    for term, _ in plan.kernel_choice.laws:
        if type(term).braking is not Term.braking:
            numbers = own(term, p)
            brakes = term.braking(numbers, np.abs(twist), p["environment.water_density"])
            total = total + np.einsum("nii->ni", brakes)
    inertias = np.einsum("nii->ni", vehicle.inertia6(p))
    return np.asarray(plan.grid.h * (total / inertias).max(axis=1))


def leaves_rotations(method: Method) -> bool:
    """Tell whether a method adds rates to R, so that R departs from a rotation by the method's error."""
    return method.tableau is not None and KINDS.get(method.name, "vector") == "vector"


def departure(rows: np.ndarray) -> np.ndarray:
    """Distance of matrices, rows (packets, 9, width), from rotations: largest entry of |R R^T - I|, (packets * width,)."""
    # Members side by side: a sum over three numbers of each would take many times as long.
    R = rows.transpose(1, 0, 2).reshape(3, 3, -1)
    largest = np.zeros(R.shape[2])
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)):
        products = R[i] * R[j]
        size = products[0].astype(np.float64)
        size += products[1]
        size += products[2]
        size -= i == j
        np.maximum(largest, np.abs(size, out=size), out=largest)
    return largest


def orthogonality_limit(plan: Watched) -> float:
    """Largest |R^T R - I| without a warning."""
    if leaves_rotations(plan.method):
        return ORTHOGONAL_TO_ERROR
    return ORTHOGONAL["float64" if plan.dtype == "float64" else "float32"]


def row_limits(plan: Watched) -> dict[str, float]:
    """Limit of each checked row."""
    method = plan.method
    known = {
        "precision": PRECISION,
        "orthogonality": orthogonality_limit(plan),
        "munk_coarse": COARSE / longest_stage(method),
        "rotation": rotation_limit(method),
        "drag": SPLIT_DRAG_NUMBER if _split(plan) else DRAG_NUMBER,
        "munk_unstable": oscillation_limit(method, MUNK),
        "energy": ENERGY,
    }
    return {row: known[row] for row in plan.spec.warning_rows}


def munk_factor(frame: Frame) -> np.ndarray:
    """Squared frequency of the fastest oscillation of the Munk moment, per |p|^2, (1 or n,) [1/(kg^2 m^2)]."""
    M = np.linalg.eigvalsh(frame.M) if np.any(frame.M[:, ~np.eye(3, dtype=bool)]) else np.einsum("nii->ni", frame.M)
    return np.asarray((1.0 / M.min(axis=1) - 1.0 / M.max(axis=1)) / frame.J.min(axis=1))


# All warnings: nothing rules any of them out.
AT_START = frozenset(Warnings)


def at_start(
    plan: Watched,
    members: Members,
    frame: Frame,
    momentum: np.ndarray,
    water: np.ndarray | None,
    among: Collection[Warnings] = AT_START,
) -> tuple[np.ndarray, np.ndarray]:
    """Warnings that follow from the members' numbers and starts.

    momentum: (m, 3) [N s], relative to the water. water: (m, 3) [m/s], its velocity in body axes; None if it rests.
    among: the possible warnings.
    Returns: (bits, value), both (m,): bits of `Warnings`, and the value of the most serious one; NaN without a warning.
    """
    m, h, method = members.count, plan.grid.h, plan.method
    bits, value = np.zeros(m, np.uint16), np.full(m, np.nan)

    def note(warning: Warnings, size: Callable[[], Any], limit: float) -> None:
        if warning not in among:
            return
        sizes = np.broadcast_to(size(), m)
        over = sizes > limit
        bits[over] |= np.uint16(warning)
        value[over] = sizes[over]

    def lost() -> np.ndarray:
        way, place = h * _size(members.velocity), np.finfo(plan.dtype).eps * _size(members.position)
        return np.divide(place, way, out=np.zeros(m), where=way > 0.0)

    @functools.cache
    def munk() -> np.ndarray:
        return np.asarray(h * np.sqrt(munk_factor(frame)) * _size(momentum))

    @functools.cache
    def swing() -> np.ndarray:
        arm = hydrostatics.moment(members.parameters) + hydrostatics.net(members.parameters)[:, None] * frame.balance
        return np.asarray(h * np.sqrt(_size(arm) / frame.J.min(axis=1)))

    note(Warnings.INERTIA, lambda: (J := np.sort(frame.J, axis=1))[:, 2] / (J[:, 0] + J[:, 1]), 1.0 + 1e-9)
    if plan.dtype != "float32_compensated":
        note(Warnings.PRECISION_LOSS, lost, PRECISION)
    if method.adaptive:
        return bits, value
    coarse = COARSE / longest_stage(method)
    note(Warnings.MUNK_COARSE, munk, coarse)
    note(Warnings.RESTORING_COARSE, swing, coarse)
    note(Warnings.ROTATION, lambda: h * _size(members.angular_velocity), rotation_limit(method))
    if _split(plan) and _dragged(plan.kernel_choice):
        note(Warnings.DRAG_STIFF, lambda: _drag_number(plan, members, water), SPLIT_DRAG_NUMBER)
    note(Warnings.MUNK_UNSTABLE, munk, oscillation_limit(method, MUNK))
    note(Warnings.RESTORING_UNSTABLE, swing, oscillation_limit(method, RESTORING))
    return bits, value


# What a bound must be below a limit, lest round-off decide.
BELOW = 1.0 - 1e-9


def possible(plan: Watched, members: Members, frame: Frame, peaks: np.ndarray) -> frozenset[Warnings]:
    """Warnings at the start that bounds over all members do not exclude; `at_start` decides on them.

    peaks: (4,), largest values that the kernel records when it packs the starts (see
        lgvi_kernels.packing.states.PEAKS).
    """
    h, method, p = plan.grid.h, plan.method, members.parameters
    momentum, rate, time, speed = np.sqrt(peaks)
    total = frame.J.sum(axis=1)
    sizes = [(Warnings.INERTIA, ((1.0 + 0.5e-9) * (total[:, None] - frame.J) < frame.J).max(), BELOW)]
    if plan.dtype != "float32_compensated":
        sizes += [(Warnings.PRECISION_LOSS, np.finfo(plan.dtype).eps * time / h, PRECISION)]
    if not method.adaptive:
        coarse = COARSE / longest_stage(method)
        munk = h * momentum * np.sqrt(_most_munk(frame))
        swing = h * np.sqrt(_longest_arm(p, frame) / frame.J.min())
        sizes += [(Warnings.MUNK_COARSE, munk, coarse), (Warnings.RESTORING_COARSE, swing, coarse)]
        sizes += [(Warnings.MUNK_UNSTABLE, munk, oscillation_limit(method, MUNK))]
        sizes += [(Warnings.RESTORING_UNSTABLE, swing, oscillation_limit(method, RESTORING))]
        sizes += [(Warnings.ROTATION, h * rate, rotation_limit(method))]
        if _split(plan) and _dragged(plan.kernel_choice):
            sizes += [(Warnings.DRAG_STIFF, _most_drag(plan, p, speed, rate), SPLIT_DRAG_NUMBER)]
    return frozenset(warning for warning, size, limit in sizes if not size < BELOW * limit)


def _most_munk(frame: Frame) -> float:
    """Upper bound of `munk_factor` over all members."""
    if len(frame.M) == 1:
        return float((munk_factor(frame) * frame.J.min(axis=1)).max() / frame.J.min())
    M = frame.mass_diagonal
    return np.inf if M is None else float((1.0 / M.min() - 1.0 / M.max()) / frame.J.min())


def _longest_arm(p: Numbers, frame: Frame) -> float:
    """Upper bound of the moment of weight and buoyancy about the frame's balance point, over all members [N m]."""

    def most(values: np.ndarray) -> float:
        return float(np.sqrt(np.einsum("ni,ni->n", values, values).max()) if values.ndim > 1 else np.abs(values).max())

    arm = most(p["vehicle.buoyancy"]) * most(p["vehicle.center_of_buoyancy"])
    if "vehicle.center_of_gravity" in p:
        arm += most(vehicle.weight(p)) * most(p["vehicle.center_of_gravity"])
    return arm + most(hydrostatics.net(p)) * most(frame.balance) if frame.balance.any() else arm


def _most_drag(plan: Watched, p: Numbers, speed: float, rate: float) -> float:
    """Upper bound of `_drag_number` over all members at speeds and rates up to these [m/s, rad/s]; infinite if unknown."""
    speeds, total = np.array([[speed] * 3 + [rate] * 3]), np.zeros(6)
    density = p["environment.water_density"].max(keepdims=True)
    for term, _ in plan.kernel_choice.laws:
        if type(term).braking is Term.braking:
            continue
        numbers = own(term, p)
        if not term.braking_grows_with or any(
            len(value) > 1 and name not in term.braking_grows_with for name, value in numbers.items()
        ):
            return np.inf
        most = {
            name: _largest_sizes(value)[None] if name in term.braking_grows_with else value
            for name, value in numbers.items()
        }
        total = total + np.einsum("nii->ni", term.braking(most, speeds, density))[0]
    least = np.einsum("nii->ni", vehicle.inertia6(p)).min(axis=0)
    return float(plan.grid.h * (total / least).max())


def _largest_sizes(values: np.ndarray) -> np.ndarray:
    """Largest magnitude of each number (n, ...) among all members."""
    largest, least = (notation.reduced(operation, values) for operation in (np.maximum, np.minimum))
    return np.asarray(np.maximum(largest, -least))


def _size(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (n, 3)."""
    return np.sqrt(np.einsum("ni,ni->n", vectors, vectors))
