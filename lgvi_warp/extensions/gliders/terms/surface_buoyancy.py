# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that decreases as a hull comes out of the water."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.physics.terms.base import CONSERVED, Array, Numbers, Packed, PackingContext, Term, number, rows_of
from lgvi_warp.physics.terms.base import side_by_side as joined
from lgvi_warp.physics.terms.cross_flow import GAUSS
from lgvi_warp.physics.terms.waves import pressure_rows, water_of, waves_of

AXIS = np.array([[1.0, 0.0, 0.0]])
# Of a slice of length l the square of the vertical extent, over that of a section of height H, is this times (l / H)^2
# where the hull stands upright: so the depths of its points scatter as much as those of the slice.
STRETCH = {"box": 1.0, "circle": 4.0 / 3.0}


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceBuoyancy(Term):
    """Buoyancy that decreases as the hull comes out of the water. The surface is at depth 0 or at the scene's waves.

    The vehicle's buoyancy is distributed over parts of the hull, centred at the centre of buoyancy. Each part loses the
    buoyancy of its section above the surface; a submerged hull keeps all buoyancy. In still water the force has a potential.

    Args:
        heights: Height of the hull's sections, (k,) [m], linear between stations; one number for a hull of one part.
        stations: Positions along the body's x axis, (k,) [m], rising, from stern to bow. Only their distances count, since
            the centroid of the volume is placed at the centre of buoyancy. With one station, the default, the hull is one
            part: the surface affects its heave but not its pitch.
        section: "circle", the default, for a round hull, whose sectional area grows as the square of the height; or "box",
            for vertical sides, whose sectional area grows as the height.

    Raises:
        SceneError: If stations do not rise, two neighbouring heights are 0, or a number is invalid (see `Term`).

    Examples:
        A ball of 80 N floats, since its buoyancy is 100 N when it is submerged.

        >>> import lgvi_warp as lw
        >>> ball = lw.Vehicle(8.0, inertia=[0.1, 0.1, 0.1], added_mass=[4.0, 4.0, 4.0], buoyancy=100.0)
        >>> scene = lw.Scene(ball, lw.Environment(gravity=10.0), terms=[lw.terms.SurfaceBuoyancy(heights=0.3, section="box"),
        ...                                                             lw.terms.Drag(linear=[20.0] * 6)])
        >>> result = lw.solve(scene, h=0.02, t1=20.0)
        >>> print(f"{result.position[-1, 0, 2]:.3f} m")
        0.090 m
    """

    type: ClassVar[str] = "surface_buoyancy"
    device: ClassVar[str] = f"{DEVICE}.surface_buoyancy"
    floats: ClassVar[bool] = True
    looks_at_surface: ClassVar[bool] = True
    unique: ClassVar[bool] = True

    heights: Any = number(("k",), "m", least=0.0)
    stations: Any = number(("k",), "m", (0.0,), rising=True)
    section: str = word("circle", known=("circle", "box"))

    def __post_init__(self) -> None:
        self.repeat(rows_of(self.stations), "heights")
        object.__setattr__(self, "waves", ())
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if _no_volume(self.heights[None])[0]:
            problem = "has no height where a part of the hull is"
            faults.add("heights", self.heights, problem, "give heights above 0 between the ends of the hull")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | {"heights": bad["heights"] | _no_volume(numbers["heights"])}

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows the waves, whose numbers it reads when it is packed.
        waves = waves_of(terms)
        if waves == vars(self)["waves"]:
            return self
        term = copy.copy(self)
        object.__setattr__(term, "waves", waves)
        return term

    @property
    def timed(self) -> bool:  # type: ignore[override]
        return bool(vars(self)["waves"]) or self.surface_level is not None

    @property
    def conserves(self) -> frozenset[str]:
        # All three in still water: its potential depends on the depth and on the attitude relative to the vertical.
        return frozenset() if self.timed else CONSERVED

    def device_in(self, aligned: bool) -> str:
        return f"{self.device}:{self.section}" + (f",{water_of(vars(self)['waves'])}" if vars(self)["waves"] else "")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Rows of the parts, and of the waves above them.
        p = context.parameters
        center = context.frame.point(p["vehicle.center_of_buoyancy"])
        values = {"axis": context.frame.vector(AXIS), "center": center}
        parts = self.parts(numbers, p["vehicle.buoyancy"])
        waves, count = pressure_rows(vars(self)["waves"], p)
        rows = [parts.reshape(len(parts), -1), *waves]
        return Packed(values | {"count": parts.shape[1], "waves": count}, joined(*rows))

    def parts(self, numbers: Numbers, buoyancy: np.ndarray) -> np.ndarray:
        """The parts of the hull.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            buoyancy: Buoyancy of the vehicle, (n,) [N].

        Returns:
            (n, parts, 6): position relative to the centre of buoyancy [m], buoyancy [N], half-height [m] and its inverse, and
            `tilt` and `stretch`. A section of height H has the vertical extent c H, where c^2 = 1 - tilt a^2 + stretch a^4 and
            a is the sine of the pitch.
        """
        x, heights, buoyancy = numbers["stations"], numbers["heights"], buoyancy[:, None]
        if x.shape[1] == 1:
            return joined(*(row[..., None] for row in np.broadcast_arrays(
                0.0 * x, buoyancy, 0.5 * heights, 2.0 / heights, 0.0 * x, 0.0 * x)))  # fmt: skip
        length = 0.5 * np.diff(x)
        at, H = (np.concatenate([table[:, :-1] + g * np.diff(table) for g in GAUSS], axis=1) for table in (x, heights))
        length = np.concatenate([length] * len(GAUSS), axis=1)
        volume = length * (H**2 if self.section == "circle" else H)
        share = volume / volume.sum(axis=1, keepdims=True)
        place = at - np.sum(share * at, axis=1, keepdims=True)
        stretch = STRETCH[self.section] * (length / H) ** 2
        rows = np.broadcast_arrays(place, buoyancy * share, 0.5 * H, 2.0 / H, np.ones_like(H), stretch)
        return np.stack(rows, axis=-1)

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array:
        # Energy (k, n) [J] of lifting what is above still water out of it; waves are left out.
        down = attitude[..., 2, :]
        middle = position[..., 2] + np.sum(parameters["vehicle.center_of_buoyancy"] * down, axis=-1)
        a = down[..., 0]
        total = np.zeros(np.shape(middle))
        parts = self.parts(numbers, parameters["vehicle.buoyancy"])
        for x, B, half, inverse, tilt, stretch in np.moveaxis(parts, (1, 2), (0, 1)):
            c = np.sqrt(1.0 - a**2 * (tilt - stretch * a**2))
            depth = middle + x * a
            u = np.clip(depth * inverse / c, -1.0, 1.0)
            lost, moment = _lost(self.section, u)
            total = total + B * (c * half * moment - depth * lost)
        return total


def _lost(section: str, u: Array) -> tuple[Array, Array]:
    """Share of a section above the water, and moment of the submerged part about the middle, divided by the half-height."""
    if section == "box":
        return 0.5 * (1.0 - u), 0.25 * (1.0 - u**2)
    w = np.sqrt(1.0 - u**2)
    return (np.arccos(u) - u * w) / np.pi, 2.0 * w**3 / (3.0 * np.pi)


def _no_volume(heights: np.ndarray) -> np.ndarray:
    """Mask (n,) of hulls with heights (n, k) in which some part has no height."""
    tallest = heights if heights.shape[1] == 1 else np.maximum(heights[:, 1:], heights[:, :-1])
    return np.any(~(tallest > 0.0), axis=1)
