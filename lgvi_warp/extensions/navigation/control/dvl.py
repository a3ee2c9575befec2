# SPDX-License-Identifier: Apache-2.0
"""A Doppler velocity log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import text
from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import MeasuringPart
from lgvi_warp.control.over_floor import packed_over, with_floor
from lgvi_warp.control.sensor import BOTTOMLESS, HANDED, MOST_TICKS, burst_levels, check_burst, is_short, level_of
from lgvi_warp.extensions.navigation import DEVICE
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, own
from lgvi_warp.physics.terms.noisy import key_of

BEAMS = 4
# Beams stand at 45 degrees from the bow.
DIAGONAL = float(np.sqrt(0.5))
MOST_ANGLE, MOST_TILT = 1.5, 3.14
# How far a beam looks for a floor on a grid where its range has no end [m].
FARTHEST = 2e4


@dataclass(frozen=True, eq=False, kw_only=True)
class DVL(MeasuringPart):
    """Doppler velocity log with four beams in a cross; each beam measures the log's velocity over ground along the beam.

        reading_i = u_i . (nu + Omega x place) + noise xi_i
        u_i = (+-sin(angle) / sqrt(2), +-sin(angle) / sqrt(2), cos(angle))

    u_i: direction of beam i in body axes, nu and Omega: velocity over ground and angular velocity, xi_i: standard normals.

    A beam has no echo if it is lost by chance, points upward, or has no floor (flat or on a grid) within its range, or if
    the tilt exceeds `greatest_tilt`. An `error_state_filter` uses each beam separately, so even a single beam helps. Without
    a filter, the measured velocity is the velocity of the point `place`, by least squares from three or four beams. With
    fewer beams there is no bottom lock, and the last velocity is kept; it is 0 before the first lock.

    Args:
        place: Position of the log (3,) [m], body axes; 0 by default.
        angle: Angle of the beams from the body's third axis [rad]; 30 degrees by default.
        noise: Standard deviation of the velocity along a beam [m/s]; 0 by default.
        dropout: Probability that a beam is lost at a tick; 0 by default.
        burst: Mean length of a run of losses of a beam [ticks], as in `lw.control.Sensor`; by default losses are
            independent.
        outlier: Probability that the reading of a beam is an outlier, independently for each beam; by default no outliers.
        outlier_std: Standard deviation of the error that an outlier adds to the reading [m/s].
        every: Number of ticks from one new reading to the next, a whole number; 1 by default.
        floor: Key of the scene's `lw.events.Floor` that reflects the beams; with "", the default, beams need no floor.
        least_range: Shortest distance along a beam to the floor [m]; 0 by default.
        greatest_tilt: Largest angle of the body's third axis from straight down at which beams have echoes [rad]; by default
            there is no limit.
        greatest_range: Longest distance along a beam to the floor [m]; inf by default.
        silent_from: Time from which the log gives no readings [s]; inf, the default, for never.
        silent_to: Time until which the log gives no readings [s]; inf, the default, for the end of the run.

    Raises:
        SceneError: If `every` is not a whole number, the range or the silent time ends before it begins, or a number is
            invalid (see `Term`). A scene refuses a log if `floor` is not one of its events.

    Examples:
        >>> import lgvi_warp as lw
        >>> log = lw.control.DVL(noise=0.01, every=2, floor="floor", greatest_range=60.0)
        >>> float(log.greatest_range)
        60.0
    """

    type: ClassVar[str] = "dvl"
    device: ClassVar[str] = f"{DEVICE}.dvl"
    linear: ClassVar[bool] = False
    every_feature: ClassVar[tuple[str, ...]] = (
        "noise",
        "dropout",
        "burst",
        "outlier",
        "floor",
        "grid",
        "silent",
        "tilt",
        HANDED,
    )
    reading: ClassVar[str] = "velocity"
    handed_flags: ClassVar[int] = BEAMS
    # The floor; set for a part of a scene.
    ground: ClassVar[Any] = None

    place: Any = number((3,), "m", (0.0, 0.0, 0.0))
    angle: Any = number((), "rad", np.pi / 6.0, above=0.0, most=MOST_ANGLE)
    noise: Any = number((), "m/s", 0.0, least=0.0)
    dropout: Any = number((), "1", 0.0, least=0.0, most=1.0)
    burst: Any = number((), "ticks", None, least=0.0, optional=True)
    outlier: Any = number((), "1", None, least=0.0, most=1.0, optional=True)
    outlier_std: Any = number((), "m/s", None, least=0.0, optional=True)
    every: Any = number((), "ticks", 1.0, least=1.0, most=MOST_TICKS)
    floor: str = text("is not a text", "give the name of a floor among the scene's events", "")
    least_range: Any = number((), "m", 0.0, least=0.0)
    greatest_range: Any = number((), "m", np.inf, least=0.0, infinite=True)
    greatest_tilt: Any = number((), "rad", None, above=0.0, most=MOST_TILT, optional=True)
    silent_from: Any = number((), "s", np.inf, infinite=True)
    silent_to: Any = number((), "s", np.inf, infinite=True)

    def check(self, faults: Faults) -> None:
        if float(self.every) != round(float(self.every)):
            near = f"{np.floor(self.every):g} or {np.ceil(self.every):g}"
            faults.add("every", float(self.every), "is not a whole number of ticks", f"give {near}")
        check_burst(self, faults)
        for first, last in (("least_range", "greatest_range"), ("silent_from", "silent_to")):
            begin, end = float(getattr(self, first)), float(getattr(self, last))
            if np.isfinite(end) and end <= begin:
                faults.add(last, end, f"is not above {first} = {begin:g}", "give a larger one, or leave it out")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | ({"burst": bad["burst"] | is_short(numbers)} if "burst" in numbers else {})

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        return with_floor(self, faults, events) if self.floor else self

    @property
    def handed_rows(self) -> int:
        return 2 * BEAMS

    def fault_channels(self, handed: bool) -> int:
        return BEAMS if handed else super().fault_channels(handed)

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # What some member has.
        acting = [name for name in ("noise", "dropout") if np.any(numbers[name])]
        acting += ["burst"] if "dropout" in acting and np.any(numbers.get("burst", 0.0)) else []
        far = all(np.any(numbers.get(name, 0.0)) for name in ("outlier", "outlier_std"))
        acting += ["outlier"] if far else []
        acting += [] if self.ground is None else ["grid" if self.ground.on_grid else "floor"]
        acting += ["silent"] if np.any(np.isfinite(numbers["silent_from"])) else []
        acting += ["tilt"] if self.greatest_tilt is not None else []
        return (*acting, HANDED) if self.is_handed else tuple(acting)

    def device_in(self, aligned: bool) -> Any:
        return f"{self.device}:{','.join(self.chosen)}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers, the key of the random numbers, and the rows of the last velocity, and of the beams.
        values: dict[str, Any] = {name: numbers[name] for name in ("place", "noise", "least_range")}
        for name in ("greatest_range", "silent_from", "silent_to"):
            values[name] = np.minimum(numbers[name], BOTTOMLESS)
        values |= {"ahead": DIAGONAL * np.sin(numbers["angle"]), "down": np.cos(numbers["angle"])}
        values |= {"every": np.rint(numbers["every"]), "key": key_of(self.key, context)}
        # A beam is lost where a standard normal is below this.
        values["dropout"] = level_of(numbers["dropout"])
        values |= burst_levels(numbers) if "burst" in self.chosen else {}
        if "outlier" in self.chosen:
            values |= {"outlier": level_of(numbers["outlier"]), "outlier_std": numbers["outlier_std"]}
        if "tilt" in self.chosen:
            values["least_down"] = np.cos(numbers["greatest_tilt"])
        # Without a filter its own memory has the rows of the beams, behind the last velocity.
        values["handed"] = self.bus.handed[self.key] if self.is_handed else 0
        first = 0 if self.is_handed else 3 + 2 * BEAMS
        memory = np.zeros((1, first + BEAMS * ("burst" in self.chosen)))
        if "grid" in self.chosen:
            reach = {"most": np.minimum(numbers["greatest_range"], FARTHEST)}
            return packed_over(self.ground, context, values | reach)._replace(memory=memory)
        flat = self.ground is not None
        values["floor"] = own(self.ground, context.parameters)["depth"] if flat else np.array([BOTTOMLESS])
        return Packed(values, memory=memory)
