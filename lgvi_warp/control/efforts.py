# SPDX-License-Identifier: Apache-2.0
"""Common parts of allocations by efforts: the effect of a channel's effort, and the command that produces this effort."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Allocation
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.actuators import UNLIMITED
from lgvi_warp.physics.terms.base import Numbers, PackingContext, number, side_by_side
from lgvi_warp.physics.terms.thrust_curves import polynomial_values, side_of_table, table_values

# The word in place of a speed at which fins are judged.
MEASURED = "measured"


@dataclass(frozen=True, eq=False, kw_only=True)
class EffortAllocation(Allocation):
    """Base class of allocations by efforts. An effort is the thrust of a thruster, a fin's angle, or a force or moment.

    Args:
        to: Key of the term that takes the commands.
        weights: Cost of each effort, (channels,), above 0; 1 by default.
        speed: Forward speed [m/s] at which the effect of fins is evaluated; 1 by default. "measured" uses, at each tick,
            the measured forward speed through the water, but at least `least_speed`.
        least_speed: Least speed [m/s] at which the effect of fins is evaluated if `speed` is "measured".
    """

    words_for: ClassVar[Mapping[str, str]] = {"speed": MEASURED}
    # Whether `speed` is "measured"; set for an object.
    measured: ClassVar[bool] = False

    weights: Any = number(("n",), "1", None, above=0.0, optional=True)
    speed: Any = number((), "m/s", 1.0, above=0.0)
    least_speed: Any = number((), "m/s", None, above=0.0, optional=True)

    def __post_init__(self) -> None:
        measured = isinstance(self.speed, str) and self.speed == MEASURED
        object.__setattr__(self, "measured", measured)
        if measured:
            object.__setattr__(self, "speed", 1.0)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if self.measured and self.least_speed is None:
            faults.add("least_speed", "", "is missing", 'give the least speed [m/s] beside speed = "measured"')
        elif self.least_speed is not None and not self.measured:
            faults.add(
                "least_speed", float(self.least_speed), "is not used", 'give speed = "measured", or leave it out'
            )

    @property
    def unused(self) -> tuple[str, ...]:
        return (*super().unused, *(("speed",) if self.measured else ()))

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        return super().with_fields(({"speed": MEASURED} if self.measured else {}) | dict(fields))

    def table_without(self, names: Collection[str]) -> dict[str, Any]:
        content = super().table_without(names)
        return content | ({"speed": MEASURED} if self.measured and "speed" not in names else {})

    @property
    def words_at_speed(self) -> str:
        """Suffix ",measured" of the device code of an allocation that uses the measured speed; else empty."""
        return ",measured" if self.measured else ""

    def check_actuator(self, faults: Faults) -> None:
        count = self.actuator.channels
        if self.measured and not np.allclose(4.0 * self._effect(1.0), self._effect(2.0)):
            fault = f"needs fins, whose effect grows with the speed squared, and that of {self.to} does not"
            faults.add(f"{self.key}.speed", MEASURED, fault, "leave speed out")
        if self.weights is not None and len(self.weights) != count:
            fault = f"has {len(self.weights)} numbers"
            faults.add(f"{self.key}.weights", self.weights, fault, f"give {count}, one for each channel of {self.to}")
        if self.shape == "polynomial" and np.any(self.actuator.limit >= UNLIMITED):
            fault = "does not end: the inverse of a polynomial needs the range of the commands"
            faults.add(f"{self.to}.limit", self.actuator.limit, fault, "give the largest command")

    @property
    def shape(self) -> str:
        """Relation of effort to command: "square", "polynomial" or "table" of thrusters, else "linear"."""
        return str(getattr(self.actuator, "shape", "linear"))

    @property
    def curve_word(self) -> str:
        """Name of the shape in the device code: "powers" and the number of powers for a polynomial, else `shape`."""
        return f"powers{self.actuator.powers}" if self.shape == "polynomial" else self.shape

    def reach(self) -> np.ndarray:
        return self._effect(self.speed)

    def _effect(self, speed: Any) -> np.ndarray:
        """Wrench of one unit of effort of each channel at a speed, in water of density 1 kg/m3."""
        numbers = {name: value[None] for name, value in self.actuator.parameters().items()}
        effect = self.actuator.effect(numbers, {"environment.water_density": np.ones(1)}, np.reshape(speed, 1))
        return np.asarray(effect[0])

    def effect_and_weights(self, numbers: Numbers, context: PackingContext) -> tuple[np.ndarray, np.ndarray]:
        """Wrenches of one unit of effort (1 or n, 6, channels), with 0 for components that no law demands, and weights."""
        effect = self.actuator.effect(context.own(self.actuator), context.parameters, numbers.get("speed", np.ones(1)))
        B = self.asked[:, None] * effect
        return B, numbers.get("weights", np.ones((1, B.shape[2])))

    def at_speed(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """Numbers of the device code that an allocation at the measured speed needs; empty for a fixed speed."""
        if not self.measured:
            return {}
        astern = 1.0 if np.allclose(self._effect(-1.0), self._effect(1.0)) else -1.0
        return {"least_speed": numbers["least_speed"], "astern": np.array([astern])}

    def channel_rows(self, B: np.ndarray, context: PackingContext, *more: np.ndarray) -> np.ndarray:
        """Rows of each channel (1 or n, channels, rows) for lgvi_kernels.laws.control.efforts; `more`: columns appended."""
        numbers, lost = context.own(self.actuator), self.lost_channels
        limit = numbers["limit"]
        keys = {"coefficient": np.ones_like(limit), "coefficient_astern": np.ones_like(limit), "dead_band": 0.0 * limit}
        curve = [numbers.get(key, value) for key, value in keys.items()]
        share = np.zeros((1, B.shape[2]))
        share[0, list(lost)] = 2.0 ** np.arange(len(lost))
        loss = self.steps_of_loss(context)
        columns = limit, *curve, loss, share, *self._largest(numbers, limit - curve[2])
        return side_by_side(np.swapaxes(B, -1, -2), *(column[..., None] for column in columns), *more)

    def _largest(self, numbers: Numbers, reach: np.ndarray) -> tuple[np.ndarray, ...]:
        """Largest efforts (1 or n, channels) ahead and astern, without the coefficient; `reach`: largest commands."""
        reach = np.maximum(reach, 0.0)
        if self.shape == "table":
            at, values = numbers["table_commands"], numbers["table_thrusts"]
            return tuple(side * table_values(at, values, side * reach) for side in (1.0, -1.0))
        if self.shape == "polynomial":
            curves = polynomials(numbers)
            turns = (highest(curve, np.max(reach, axis=-1))[:, None] for curve in curves)
            return tuple(
                polynomial_values(curve, np.minimum(reach, turn)) for curve, turn in zip(curves, turns, strict=True)
            )
        return (reach if self.shape == "linear" else reach**2,) * 2

    def curves(self, numbers: Numbers) -> tuple[np.ndarray, int]:
        """Rows of the curves and then of their inverses, and the number of rows of the curves."""
        if self.shape in ("linear", "square"):
            return np.zeros((1, 0)), 0
        curves, size = self.actuator.curve_rows(numbers)
        if self.shape == "table":
            at, values = numbers["table_commands"], numbers["table_thrusts"]
            each = (
                side_of_table(at, values[:, :, i], side) for i in range(self.actuator.channels) for side in (1.0, -1.0)
            )
            return side_by_side(curves, *(rising_knots(thrusts, commands) for commands, thrusts in each)), size
        reach = np.max(np.maximum(numbers["limit"] - numbers["dead_band"], 0.0), axis=-1)
        sides = (inverse_rows(polynomial, reach) for polynomial in polynomials(numbers))
        return side_by_side(curves, *sides), size

    def kind_of_curves(self, numbers: Numbers) -> dict[str, int]:
        """Flags (1 or 0). sided: some member's polynomials differ ahead and astern. odd: none do, and all are odd."""
        ahead, astern = polynomials(numbers) if self.shape == "polynomial" else (np.zeros((1, 0)),) * 2
        same = np.array_equal(ahead, astern)
        return {"sided": int(not same), "odd": int(same and not np.any(ahead[:, 1::2]))}


# Singular values below this part of the largest count as zero.
RANK = 1e-10


def polynomials(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Polynomials of thrusters ahead, and those astern."""
    return numbers["polynomial"], numbers["polynomial_astern"]


def pseudo_inverse(B: np.ndarray, weights: np.ndarray, lost: Sequence[int]) -> np.ndarray:
    """The weighted pseudo-inverse (n, channels, 6) of the effect B, with 0 for lost channels."""
    scaled = B / np.sqrt(weights)[:, None, :]
    scaled[:, :, list(lost)] = 0.0
    return np.asarray(np.linalg.pinv(scaled, rcond=RANK) / np.sqrt(weights)[:, :, None])


def rising_knots(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Rows of piecewise linear functions with values (n, k) at the points `at`; repeated equal knots are allowed."""
    width = np.diff(at, axis=1)
    inverse = np.divide(1.0, width, out=np.zeros_like(width), where=width > 0.0)
    steps = np.stack([at[:, :-1], inverse, np.diff(values, axis=1)], axis=-1)
    return np.concatenate([values[:, :1], steps.reshape(len(at), -1)], axis=1)


# Points at which a polynomial is looked at for its turn, and coefficients of the start of its inverse.
POINTS, START_SIZE = 1025, 16
# Chebyshev's points for the start of its inverse, both ends among them: there it is exact, where steps crawl. And
# from the values there to the coefficients.
POINTS_OF_START = np.cos(np.pi * np.arange(START_SIZE) / (START_SIZE - 1))
TO_COEFFICIENTS = np.linalg.inv(np.polynomial.polynomial.polyvander(POINTS_OF_START, START_SIZE - 1))


def inverse_rows(polynomial: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Initial guess of the inverse of polynomials f (1 or n, powers), from 0 to their first maximum or their reach (1 or n,).

    The guess is a polynomial in 2 s - 1, where f = (largest f) (1 - (1 - s^2)^2). In s the inverse is smooth both where f
    begins as a square and at its maximum (lgvi_kernels.laws.thrust_curves).

    Returns: Rows (1 or n, 20): 1 / largest value, the largest value, its argument, the least slope, and the coefficients.
    """
    polynomial, reach = repeated(polynomial, reach)
    top = highest(polynomial, reach)
    most = polynomial_values(polynomial, top[:, None])[:, 0]
    wanted = most[:, None] * (1.0 - (1.0 - (0.5 * (POINTS_OF_START + 1.0)) ** 2) ** 2)
    inverses = _last(
        lambda w: polynomial_values(polynomial, w) < wanted, np.zeros_like(wanted), top[:, None] + 0.0 * wanted
    )
    acts = most > 0.0
    inverse = np.divide(1.0, most, out=np.zeros_like(most), where=acts)
    slope = np.where(acts, 1e-3 * most / np.where(acts, top, 1.0), 1.0)
    # Summed row by row: a product of matrices rounds otherwise with other members beside.
    coefficients = (inverses[:, None, :] * TO_COEFFICIENTS).sum(axis=-1)
    return side_by_side(*(x[:, None] for x in (inverse, most, top, slope)), coefficients)


def highest(polynomial: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Argument (1 or n,) of the first maximum of polynomials (1 or n, powers) without constant part, or their reach."""
    polynomial, reach = repeated(polynomial, reach)
    points = reach[:, None] * np.linspace(0.0, 1.0, POINTS)
    values = polynomial_values(polynomial, points)
    falls = np.diff(values, axis=1) <= 0.0
    turns = falls.any(axis=1)
    turn = np.where(turns, falls.argmax(axis=1), POINTS - 1)
    # The slope changes its sign within one of the two intervals beside that point.
    row, slopes = np.arange(len(points)), polynomial * np.arange(1, polynomial.shape[1] + 1)
    before, after = points[row, np.maximum(turn - 1, 0)], points[row, np.minimum(turn + 1, POINTS - 1)]
    peak = _last(lambda w: polynomial_values(slopes, w) > 0.0, before[:, None], after[:, None])[:, 0]
    return np.where(turns, np.where(turn > 0, peak, 0.0), reach)


def _last(holds: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Points up to which conditions hold, elementwise, by bisection between `low`, where they hold, and `high`."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = holds(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return high
