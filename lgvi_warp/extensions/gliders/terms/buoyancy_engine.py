# SPDX-License-Identifier: Apache-2.0
"""A buoyancy engine: a pump between two volumes that reverses at two depths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.extensions.gliders.terms.ballast import SEA_WATER, specific_weight
from lgvi_warp.extensions.gliders.terms.density_profile import in_profile, profile_rows
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number

SIDES = ("down", "up")
# Those that the device reads as they are.
NUMBERS = ("pump_rate", "volume_down", "volume_up", "depth_top", "depth_bottom", "gradient", "reference_depth")


@dataclass(frozen=True, eq=False, kw_only=True)
class BuoyancyEngine(Term):
    """A volume V in addition to the hull, which a pump changes to `volume_down` or `volume_up`: force -rho(d) g V R^T e3.

    rho(d) is the density of the water at the depth d, and R^T e3 the downward vertical in body axes. In a dive, the pump
    starts to pump to `volume_up` when the body's origin reaches `depth_bottom`. In an ascent, it starts to pump to
    `volume_down` when the origin reaches `depth_top` (Graver 2005, 4; Eriksen et al. 2001). The time at which the pump starts
    is located within the step, to second order.

    With an efficiency, the pump's work is part of the energy used (`EnergyUse`). The energy is the water's pressure relative
    to the surface, times the volume that is pumped out, divided by the efficiency. If the pressure pushes volume back in,
    no energy is used or recovered.

    Args:
        pump_rate: Rate q of the pump [m3/s].
        volume_down: Volume during a dive [m3], most often below 0.
        volume_up: Volume during an ascent [m3], above `volume_down`.
        depth_top: Depth at which an ascent ends and a dive begins [m].
        depth_bottom: Depth at which a dive ends and an ascent begins [m], deeper than `depth_top`.
        position: Point at which the volume acts, (3,) [m] from the body's origin; the origin by default.
        volume_start: Volume at the start [m3]; by default the volume for the direction `first`.
        gradient: Relative change of the water's density per depth [1/m], as in `Stratification`; 0 by default.
        reference_depth: Depth at which the density is that of the environment [m]; 0 by default.
        efficiency: Work against the water's pressure divided by the electrical energy of the pump, above 0 and at most 1. If
            omitted, the energy used does not include the pump.
        first: Direction at the start: "down", the default, or "up".

    Raises:
        SceneError: If `volume_down` is not below `volume_up`, `depth_top` is not above `depth_bottom`, or a number is invalid
            (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> engine = lw.terms.BuoyancyEngine(
        ...     pump_rate=2e-5, volume_down=-2e-4, volume_up=2e-4, depth_top=5.0, depth_bottom=30.0
        ... )
        >>> scene = lw.Scene.named("torpedo", terms=[engine])
        >>> result = lw.solve(scene, h=0.1, t1=1.0)
        >>> print(f"{1000 * result.position[-1, 0, 2]:.1f} mm down")
        15.0 mm down
    """

    type: ClassVar[str] = "buoyancy_engine"
    device: ClassVar[str] = f"{DEVICE}.buoyancy_engine"
    looks_at_surface: ClassVar[bool] = True
    # The density of the water by depth, where the scene has a profile; set for a term of a scene.
    profile: ClassVar[Any] = None
    usual: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("depth_top", "depth_bottom", "reference_depth"), "a place in the sea may be anywhere"
    )

    pump_rate: Any = number((), "m3/s", above=0.0)
    volume_down: Any = number((), "m3")
    volume_up: Any = number((), "m3")
    depth_top: Any = number((), "m")
    depth_bottom: Any = number((), "m")
    position: Any = number((3,), "m", (0.0, 0.0, 0.0), axes="point")
    volume_start: Any = number((), "m3", None)
    gradient: Any = number((), "1/m", 0.0)
    reference_depth: Any = number((), "m", 0.0)
    efficiency: Any = number((), "1", None, above=0.0, most=1.0, optional=True)
    first: str = word("down", known=SIDES)

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows the density of the water by depth.
        return in_profile(self, terms)

    def __post_init__(self) -> None:
        if self.volume_start is None:
            object.__setattr__(
                self,
                "volume_start",
                self.volume_up if isinstance(self.first, str) and self.first == "up" else self.volume_down,
            )
        super().__post_init__()

    @property
    def memory(self) -> bool:
        return True

    @property
    def powered(self) -> bool:
        """Whether the scene's energy account includes the pump's work."""
        return self.accounted and self.efficiency is not None

    def device_in(self, aligned: bool) -> str:
        features = [*["power"] * self.powered, *["profile"] * (self.profile is not None)]
        return f"{self.device}:{','.join(features)}" if features else self.device

    def check(self, faults: Faults) -> None:
        for low, high in (("volume_down", "volume_up"), ("depth_top", "depth_bottom")):
            if getattr(self, low) >= getattr(self, high):
                faults.add(
                    high,
                    getattr(self, high),
                    f"is not above {low} = {getattr(self, low)}",
                    f"give {high} > {low}",
                )

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses members whose volumes or depths are in the wrong order.
        bad = super().unphysical(numbers)
        for low, high in (("volume_down", "volume_up"), ("depth_top", "depth_bottom")):
            bad[high] = bad[high] | (numbers[low] >= numbers[high])
        return bad

    def drive(self) -> np.ndarray:
        # The larger buoyancy along any axis, and its moments, in sea water.
        lift, arm = max(abs(self.volume_down), abs(self.volume_up)), np.abs(self.position)
        return SEA_WATER * lift * np.array([1.0, 1.0, 1.0, *np.maximum(arm[[1, 0, 0]], arm[[2, 2, 1]])])

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Numbers, and the memory: volume, side, volume and depth at the last look, and -1 for none; with power its pressure.
        values: dict[str, Any] = {name: numbers[name] for name in NUMBERS}
        values["weight"] = specific_weight(context.parameters)
        values["point"] = context.frame.point(numbers["position"])
        values["origin"] = context.frame.point(np.zeros((1, 3)))
        volume = numbers["volume_start"]
        side = np.array([1.0 if self.first == "up" else -1.0])
        rows = [volume, side, volume, np.zeros(1), np.array([-1.0])]
        if self.powered:
            # Where the account lies is filled in with the rows of the memory.
            values |= {"efficiency": numbers["efficiency"], "account_row": -1}
            rows.append(np.zeros(1))
        memory = np.stack(repeated(*rows), axis=-1)
        if self.profile is None:
            return Packed(values, memory=memory)
        table, count = profile_rows(self, context.parameters)
        return Packed(values | {"density_knots": count}, table, memory)
