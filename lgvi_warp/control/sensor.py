# SPDX-License-Identifier: Apache-2.0
"""Sensors, whose readings replace the true values in the measured motion."""

from __future__ import annotations

import copy
from collections.abc import Collection, Sequence
from dataclasses import Field, dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults, among
from lgvi_warp.control.base import READINGS, MeasuringPart
from lgvi_warp.physics.given_draws import Stream
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.base import side_by_side as joined
from lgvi_warp.physics.terms.noisy import key_of
from lgvi_warp.physics.terms.waves import WaveTerm, pressure_rows, water_of, waves_of

# Numbers of a sensor, in the order of its device code, with the value that has no effect; those of each axis, those of ticks.
VECTORS = ("bias", "noise", "drift", "quantum", "outlier_std")
IDLE = dict.fromkeys(VECTORS, 0.0) | {"every": 1.0, "latency": 0.0, "dropout": 0.0, "deepest": np.inf}
IDLE |= {"burst": 0.0, "outlier": 0.0}
DRAWING = frozenset({"noise", "drift", "dropout", "outlier"})
# Numbers that do nothing unless another one acts as well.
IDLE_WITHOUT = {"burst": "dropout", "outlier": "outlier_std", "outlier_std": "outlier"}
KEEPING = frozenset({"every", "latency", "dropout", "deepest"})
# What a sensor may read of a place of its own.
OF_A_PLACE = ("position", "depth")
# What its device code has where it is not at the body's origin.
PLACED = "place"
# What its device code has where the call gives its normals.
GIVEN = "given"
# What it has where it reads a depth by the pressure: in still water, below waves in deep water, and in water with a floor.
PRESSURE = ("still", "waves", "finite")
# What it has where a tide moves the surface above it.
TIDE = "tide"
# What it has where an estimator takes its readings.
HANDED = "handed"
# Below any depth, within float32.
BOTTOMLESS = 1e30
MOST_TICKS = 1000.0
# What an altimeter reads, a sensor of its own.
RANGE = "range"


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor(MeasuringPart):
    """Sensor of one quantity: truth + bias + random walk + noise, rounded; with a rate, a latency and lost readings.

    Errors are in the unit of the measured quantity: m, rad, m/s or rad/s. For a 3-vector, give one number for all axes or
    three numbers. The errors of an attitude turn it by a rotation vector in body axes, and its quantum applies to
    roll, pitch and yaw. The errors of a heading turn it about the vertical. The random numbers follow from the seed, the
    member, the tick and the sensor's name, so they are the same for all gains, methods and steps.

    Args:
        of: Measured quantity: "depth", "heading", "position", "attitude", "velocity" (over ground), "water_velocity" or
            "angular_velocity"; velocities are in body axes.
        noise: Standard deviation of the noise of each reading; 0 by default.
        bias: Constant error added to each reading; 0 by default.
        drift: Standard deviation of the random walk after 1 s, in the unit of the reading / s^1/2; 0 by default.
        quantum: Readings are rounded to whole multiples of this number; 0 by default, for no rounding.
        every: Number of ticks from one new reading to the next; 1 by default. In between, the last reading is kept.
        latency: Number of ticks after which a reading arrives; 0 by default. Until then the first reading is used.
        dropout: Probability that a reading is lost, in which case the last reading is kept; 0 by default.
        burst: Mean length of a run of lost readings [ticks], at least 1 and at least dropout / (1 - dropout). By default, or
            at 0, losses are independent. The fraction of lost readings stays `dropout` (Gilbert 1960, a chain of two states).
        outlier: Probability that a reading is an outlier; by default there are no outliers.
        outlier_std: Standard deviation of the error that an outlier adds to the reading.
        deepest: Depth of the sensor below which readings are lost [m], as for GPS; inf by default.
        place: Point of the body at which a sensor of position or depth is mounted, (3,) [m], body axes; by default the
            body's origin. The sensor reads the position or depth of this point.
        reads: Kind of depth reading. "geometry", the default, is the depth below the mean surface. "pressure" is the
            reading p / (rho g) of a pressure cell below the scene's tide. It includes the pressure of waves by linear theory,
            which decays with depth. Out of the water the reading is 0.

    The reading of the first tick always arrives, without latency and at any depth: it stands for a reading on deck before
    the run. A `DVL`, which needs the floor, has no such reading: its velocity is 0 before the first lock.

    An estimator that names the sensor (see lw.control.ErrorStateFilter) takes the readings itself. The sensor then does not
    change the measured motion, no reading is repeated, the first may be lost, and the estimator accounts for the latency.

    Raises:
        SceneError: If `of` is unknown, `every` or `latency` is not a whole number, `place` is given for a sensor of a
            quantity other than position or depth, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.Sensor(of="position", noise=0.5, every=10).noise
        array([0.5, 0.5, 0.5])
    """

    type: ClassVar[str] = "sensor"
    every_feature: ClassVar[tuple[str, ...]] = (*IDLE, PLACED, *PRESSURE, TIDE, GIVEN, HANDED)
    handed_flags: ClassVar[int] = 1
    # The waves whose pressure it reads; set for a part of a scene.
    waves: ClassVar[tuple[WaveTerm, ...]] = ()

    of: str = ""
    noise: Any = number((3,), "unit", 0.0, least=0.0)
    bias: Any = number((3,), "unit", 0.0)
    drift: Any = number((3,), "unit/s^1/2", 0.0, least=0.0)
    quantum: Any = number((3,), "unit", 0.0, least=0.0)
    every: Any = number((), "ticks", IDLE["every"], least=1.0, most=MOST_TICKS)
    latency: Any = number((), "ticks", IDLE["latency"], least=0.0, most=MOST_TICKS)
    dropout: Any = number((), "1", IDLE["dropout"], least=0.0, most=1.0)
    deepest: Any = number((), "m", IDLE["deepest"], infinite=True)
    # Absent where they are not given, so that a sensor without them has no such parameters.
    burst: Any = number((), "ticks", None, least=0.0, optional=True)
    outlier: Any = number((), "1", None, least=0.0, most=1.0, optional=True)
    outlier_std: Any = number((3,), "unit", None, least=0.0, optional=True)
    place: Any = number((3,), "m", None, optional=True)
    reads: str = word("geometry", known=("geometry", "pressure"))

    def __post_init__(self) -> None:
        if not among(self.of, [RANGE]):
            faults = Faults(f"{self.key}.")
            faults.choice("of", self.of, READINGS)
            faults.raise_if_any()
        if self.count > 1:
            self.repeat(self.count, *VECTORS)
        super().__post_init__()

    @property
    def estimates_position(self) -> bool:
        return self.of == "position"

    @property
    def count(self) -> int:
        """Count of numbers in a reading."""
        return READINGS[self.of]

    @property
    def reading(self) -> str:  # type: ignore[override]
        """The measured quantity, among READINGS."""
        return self.of

    def fault_channels(self, handed: bool) -> int:
        return self.count

    def shape_of(self, item: Field[Any]) -> tuple[Any, ...]:
        # One number for each that it reads; a sensor of a scalar has scalars.
        return () if self.count == 1 and item.name != PLACED else super().shape_of(item)

    def check(self, faults: Faults) -> None:
        for name in ("every", "latency"):
            value = float(getattr(self, name))
            if value != round(value):
                near = f"{np.floor(value):g} or {np.ceil(value):g}"
                faults.add(name, value, "is not a whole number of ticks", f"give {near}")
        check_burst(self, faults)
        if self.place is not None and not among(self.of, OF_A_PLACE):
            remedy = "leave it out" if not among(self.of, [RANGE]) else "give point"
            faults.add("place", self.place, f"has no meaning for a sensor of {self.of}", remedy)
        if self.reads == "pressure" and not among(self.of, ["depth"]):
            faults.add(
                "reads", self.reads, f"has no meaning for a sensor of {self.of}", 'leave it out, or give of = "depth"'
            )

    @property
    def looks_at_surface(self) -> bool:  # type: ignore[override]
        return self.reads == "pressure"

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows the waves whose pressure it reads.
        waves = waves_of(terms) if self.reads == "pressure" else ()
        if waves == self.waves:
            return self
        sensor = copy.copy(self)
        object.__setattr__(sensor, "waves", waves)
        return sensor

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | ({"burst": bad["burst"] | is_short(numbers)} if "burst" in numbers else {})

    @property
    def ticks_before(self) -> int:
        # Those until a reading arrives, and the one at which it does.
        late = int(np.max(self.latency))
        return late + 1 if late else 0

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # The names of the numbers that matter for some member.
        given = {name: idle for name, idle in IDLE.items() if name in numbers}
        acting = tuple(name for name, idle in given.items() if np.any(_whole(name, numbers[name]) != idle))
        acting = tuple(name for name in acting if IDLE_WITHOUT.get(name, name) in acting)
        placed: tuple[str, ...] = (PLACED,) if np.any(numbers.get(PLACED, 0.0)) else ()
        if self.reads == "pressure":
            placed += (water_of(self.waves) if self.waves else "still",) + (TIDE,) * (self.surface_level is not None)
        return (
            (*(name for name in acting if name != "latency"), *placed, HANDED) if self.is_handed else (*acting, *placed)
        )

    @property
    def handed_rows(self) -> int:
        # Its numbers, and whether they are new.
        return self.count + 1

    def streams(self, acting: Collection[str]) -> tuple[Stream, ...]:
        """Streams of the sensor's random draws.

        Args:
            acting: Names of the sensor's numbers that vary or are not zero.

        Returns:
            The streams of these numbers, drawn at each tick.
        """
        count = self.count
        drift = Stream("drift", 1, 0, 1) if count == 1 else Stream("drift", 3, 1)
        each = (
            *(Stream("noise", count), drift, Stream("dropout", 1, 0, 3)),
            *(Stream("outlier", 1, 2, 3), Stream("outlier_std", count, 2)),
        )
        return tuple(stream for stream in each if stream.name in acting)

    def device_in(self, aligned: bool) -> Any:
        return f"sensor:{','.join((self.of, *self.chosen))}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers that matter, the key of the random numbers, and the rows of what it keeps.
        chosen, count = set(self.chosen), self.count
        handed = HANDED in chosen
        values: dict[str, Any] = {name: _vector(numbers[name]) for name in VECTORS if name in chosen}
        values |= {name: _whole(name, numbers[name]) for name in ("every", "latency") if name in chosen}
        if PLACED in chosen:
            values[PLACED] = numbers[PLACED]
        if "deepest" in chosen:
            values["deepest"] = np.minimum(numbers["deepest"], BOTTOMLESS)
        if handed:
            values["handed"] = self.bus.handed[self.key]
        if "dropout" in chosen:
            # A reading is lost where a standard normal is below this.
            values["dropout"] = level_of(numbers["dropout"])
        if "burst" in chosen:
            values |= burst_levels(numbers)
        if "outlier" in chosen:
            values["outlier"] = level_of(numbers["outlier"])
        if chosen & DRAWING and context.given is not None:
            values["key"] = {
                "row": 0,
                **dict.fromkeys(sorted({*DRAWING, "outlier_std"}), 0),
                **context.given.places(self.key),
            }
        elif chosen & DRAWING:
            values["key"] = key_of(self.key, context)
        sets = 1 + (int(values["latency"].max()) if "latency" in chosen else 0)
        rows = 9 if self.of == "attitude" else count
        kept = (sets + 1) * rows + 1 if chosen & KEEPING and not handed else 0
        memory = np.zeros((1, count * ("drift" in chosen) + ("burst" in chosen) + kept))
        above, waves = pressure_rows(self.waves, context.parameters)
        if above:
            return Packed(values | {"sets": sets, "waves": waves}, joined(*above), memory)
        return Packed(values | {"sets": sets}, memory=memory)


def level_of(chance: np.ndarray) -> np.ndarray:
    """The level below which a standard normal number lies with a given probability, within the range of float32."""
    from scipy.special import ndtri

    return np.asarray(np.clip(ndtri(chance), -BOTTOMLESS, BOTTOMLESS))


def burst_levels(numbers: Numbers) -> dict[str, np.ndarray]:
    """Levels of normal numbers below which a burst of lost readings begins, and continues, from `dropout` and `burst`."""
    lost, length = repeated(numbers["dropout"], numbers["burst"])
    apart = length == 0.0
    ends = 1.0 / np.where(apart, 1.0, length)
    begins = np.where(lost < 1.0, lost * ends / np.where(lost < 1.0, 1.0 - lost, 1.0), 1.0)
    return {"begins": level_of(np.where(apart, lost, begins)), "stays": level_of(np.where(apart, lost, 1.0 - ends))}


def is_short(numbers: Numbers) -> np.ndarray:
    """Mask (n,) of members whose mean length of a burst is too short for their share of lost readings."""
    lost, length = repeated(numbers["dropout"], numbers["burst"])
    return np.asarray((length > 0.0) & ((length < 1.0) | (lost > (1.0 - lost) * length)) & (lost < 1.0))


def check_burst(part: Any, faults: Faults) -> None:
    """Add a fault if the mean length of a burst is too short."""
    if part.burst is not None and is_short({name: np.array([getattr(part, name)]) for name in ("dropout", "burst")})[0]:
        least = max(1.0, float(part.dropout) / (1.0 - float(part.dropout)))
        problem = f"is too short for dropout = {float(part.dropout):g}"
        faults.add("burst", float(part.burst), problem, f"give at least {least:g}, or 0")


def _vector(values: np.ndarray) -> np.ndarray:
    """Values (n,) or (n, 3) as 3-vectors; a scalar becomes the first component."""
    return values if values.ndim > 1 else values[:, None] * np.eye(3)[0]


def _whole(name: str, values: np.ndarray) -> np.ndarray:
    """Values, rounded if they are numbers of ticks, since draws for members need not be whole."""
    return np.rint(values) if name in ("every", "latency") else values
