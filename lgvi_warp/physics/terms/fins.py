# SPDX-License-Identifier: Apache-2.0
"""Fixed fins: lift and drag of small wings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import (
    MOST_UNROLLED,
    Numbers,
    Packed,
    PackingContext,
    Term,
    number,
    rows_of,
    side_by_side,
)

# Below this sine of the angle between them, chord and normal count as parallel.
PARALLEL = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class Fins(Term):
    """n fixed fins with lift rho A/2 lift_slope sin(a) cos(a) V^2 and drag rho A/2 (drag + drag_normal sin^2 a) V^2.

    V and a are the speed and angle of attack of the flow in the plane of chord and normal, and rho is the density of the
    water. A single number stands for n equal numbers.

    Args:
        position: Point at which each fin's force acts, (n, 3) [m] from the body's origin.
        chord: Direction from trailing to leading edge, (n, 3), of any length but 0.
        normal: Direction of lift, (n, 3), of any length but 0; its component along the chord is removed.
        area: Area A, (n,) [m2].
        lift_slope: Slope of the lift coefficient, (n,) [1/rad].
        drag: Drag coefficient along the flow, (n,).
        drag_normal: Factor of sin^2 a in the drag coefficient, (n,); 0 by default.

    Raises:
        SceneError: If chord and normal are parallel, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "fins"
    pattern_device: ClassVar[str] = "fins_pattern"
    braking_grows_with: ClassVar[tuple[str, ...]] = ("area", "lift_slope", "drag", "drag_normal")

    position: Any = number(("n", 3), "m")
    chord: Any = number(("n", 3), "1")
    normal: Any = number(("n", 3), "1")
    area: Any = number(("n",), "m2", least=0.0)
    lift_slope: Any = number(("n",), "1/rad", least=0.0)
    drag: Any = number(("n",), "1", least=0.0)
    drag_normal: Any = number(("n",), "1", 0.0, least=0.0)

    def __post_init__(self) -> None:
        self.repeat(rows_of(self.position), "area", "lift_slope", "drag", "drag_normal")
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        for i, (chord, normal) in enumerate(zip(self.chord, self.normal, strict=True)):
            if not np.any(chord):
                remedy = "give the direction from trailing to leading edge, such as [1, 0, 0]"
                faults.add(f"chord[{i}]", chord, "has zero length", remedy)
            elif not np.any(normal):
                faults.add(f"normal[{i}]", normal, "has zero length", "give a direction across the fin's plane")
            elif _degenerate(chord, normal):
                faults.add(f"normal[{i}]", normal, "is along the chord", "give a direction across the fin's plane")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses members whose chord and normal span no plane.
        bad = super().unphysical(numbers)
        chord, normal = np.nan_to_num(numbers["chord"]), np.nan_to_num(numbers["normal"])
        bad["chord"] = bad["chord"] | ~np.all(np.any(chord, axis=-1), axis=-1)
        bad["normal"] = bad["normal"] | np.any(_degenerate(chord, normal), axis=-1)
        return bad

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # The derivative along each normal, at the whole speed, as if lift and both kinds of drag acted at once.
        slope = numbers["lift_slope"] + 2.0 * (numbers["drag"] + numbers["drag_normal"])
        size = 0.5 * water_density[:, None] * numbers["area"] * slope * np.linalg.norm(speeds[:, :3], axis=1)[:, None]
        normal = numbers["normal"] / np.linalg.norm(numbers["normal"], axis=-1, keepdims=True)
        arm = np.cross(numbers["position"], normal)
        rows = np.concatenate(np.broadcast_arrays(normal, arm), axis=-1)
        return np.asarray(np.einsum("nk,nki,nkj->nij", size, rows, rows))

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        # Of the twists in the user's axes and about his origin; none of many fins, whose code is a loop.
        found = {kind: _twist(numbers["position"], direction)
                 for kind, direction in zip("cn", unit_directions(numbers), strict=True)}  # fmt: skip
        return tuple(f"{fin}{kind}{i}" for kind, rows in found.items() for fin in range(rows.shape[1]) for i in range(6)
                     if rows.shape[1] <= MOST_UNROLLED and np.any(rows[:, fin, i]))  # fmt: skip

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        rows = fin_rows(numbers, context)
        count = rows.shape[1]
        return Packed({"count": count}, rows.reshape(len(rows), -1), work=2 * count)


def _degenerate(chord: np.ndarray, normal: np.ndarray) -> Any:
    """Mask (...) of normals (..., 3) that are parallel to their chords."""
    size = np.linalg.norm(chord, axis=-1) * np.linalg.norm(normal, axis=-1)
    return np.linalg.norm(np.cross(chord, normal), axis=-1) <= PARALLEL * size


def unit_directions(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Chords and normals (members, fins, 3) of length 1; the normals are orthogonal to the chords."""
    chord = numbers["chord"] / np.linalg.norm(numbers["chord"], axis=-1, keepdims=True)
    normal = numbers["normal"] - np.sum(numbers["normal"] * chord, axis=-1, keepdims=True) * chord
    return chord, normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def fin_rows(numbers: Numbers, context: PackingContext, matrices: bool = True) -> np.ndarray:
    """Device rows (members, fins, 51) of fins: their twists c and n, rho A/2 times the three coefficients, and S and W.

    S = c c^T + n n^T and W = n c^T - c n^T, block by block (lgvi_kernels/laws/fins.py). matrices: Whether to include S and W,
    which are needed if the angle of the flow counts.
    """
    chord, normal = unit_directions(numbers)
    half = 0.5 * context.parameters["environment.water_density"][:, None] * numbers["area"]
    sizes = [half * numbers[name] for name in ("lift_slope", "drag", "drag_normal")]
    c, n = (twist(context.frame, numbers["position"], direction) for direction in (chord, normal))
    first = (c, n, *(size[..., None] for size in sizes))
    if not matrices:
        return side_by_side(*first)
    cc, nn, nc = (a[..., :, None] * b[..., None, :] for a, b in ((c, c), (n, n), (n, c)))
    S, W = cc + nn, nc - np.swapaxes(nc, -1, -2)
    off = ([1, 2, 0], [2, 0, 1])
    blocks: list[np.ndarray] = []
    for half_twist in (slice(0, 3), slice(3, 6)):
        s, w = S[..., half_twist, half_twist], W[..., half_twist, half_twist]
        blocks.append(np.concatenate([np.diagonal(s, axis1=-2, axis2=-1), s[..., *off], w[..., *off]], axis=-1))
    between = [matrix[..., :3, 3:].reshape(*matrix.shape[:-2], 9) for matrix in (S, W)]
    return side_by_side(*first, blocks[0], *between, blocks[1])


def _twist(point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """`twist` in the user's axes and about the user's origin."""
    point, direction = np.broadcast_arrays(point, direction)
    return np.concatenate([direction, np.cross(point, direction)], axis=-1)


def twist(frame: Frame, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Rows that give the velocity of a point (n, ..., 3) [m] along a unit vector, and the wrench of a unit force there."""
    *_, point, direction = repeated(frame.Q, frame.forces, point, direction)
    return np.concatenate([frame.vector(direction), frame.torque(np.cross(point, direction), direction)], axis=-1)
