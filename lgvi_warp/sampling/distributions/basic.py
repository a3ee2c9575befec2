# SPDX-License-Identifier: Apache-2.0
"""Distributions of single numbers, as quantile functions.

Every distribution maps uniform numbers in (0, 1) to values, so it works with any sampling of the unit cube.
"""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.arguments import explained
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import FAR
from lgvi_warp.common.real_numbers import settle, settles_first

Spread = float | tuple[float, ...] | list[float] | np.ndarray


@explained
@dataclass(frozen=True)
class Distribution(Documented):
    """Base class: the distribution of a quantity, by default about the scene's value.

    Each setting is one number for all components, or one number per component, in the unit of the quantity.

    Class attributes: `kind` is the name in a scene file; `widths` names arguments of which exactly one must set the
    width.

    Raises:
        SceneError: If a number is wrong. The message lists every fault.
    """

    kind: ClassVar[str] = ""
    # Classes by their kind in a scene file.
    kinds: ClassVar[MutableMapping[str, Any]] = registry.Kinds(
        "lgvi_warp.sampling.distributions",
        {
            "basic": ("normal", "uniform", "lognormal", "truncated_normal", "choice"),
            "joint": (
                *("correlated_normal", "rotation_normal", "uniform_rotation"),
                *("positive_definite", "physical_inertia", "levels"),
            ),
            "named": ("scipy", "histogram", "own"),
            "density": ("kernel_density",),
            "copula": ("copula",),
            "factor": ("factor",),
            "derived": ("derived",),
            "openturns": ("openturns",),
        },
    )
    widths: ClassVar[tuple[str, ...]] = ()
    # Whether its numbers may be one for each component of what it varies.
    by_component: ClassVar[bool] = True
    # Whether it may draw several quantities together, named "a, b".
    several: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        settles_first(cls)
        if cls.__module__.startswith(__package__.partition(".")[0]):
            explained(cls)
        registry.add(cls.kinds, cls, "kind")

    def __post_init__(self) -> None:
        settle(self)
        faults = Faults(f"{self.kind}.")
        widths_given = [name for name in self.widths if getattr(self, name) is not None]
        if self.widths and len(widths_given) != 1:
            remedy = f"give one of {', '.join(self.widths)}"
            faults.add(" and ".join(widths_given) or "width", "...", f"{len(widths_given)} given", remedy)
        values = {name: faults.finite(name, value) for name, value in self.numbers_by_name().items()}
        for name, array in values.items():
            if array is not None and name not in ("mean", "median", "low", "high", "values") and np.any(array < 0.0):
                faults.add(name, array, "is negative", "give a spread from 0")
        low, high = values.get("low"), values.get("high")
        if low is not None and high is not None and not ordered(low, high):
            faults.add("low and high", (low.tolist(), high.tolist()), "are not in order", "give low < high")
        self._check_more(faults)
        faults.raise_if_any()

    def numbers_by_name(self) -> dict[str, Any]:
        """The given numbers, by the names of their fields."""
        return {item.name: getattr(self, item.name) for item in fields(self) if getattr(self, item.name) is not None}

    def _check_more(self, faults: Faults) -> None:
        """Add faults that are specific to this kind of distribution."""

    @property
    def joint(self) -> bool:
        """True if it draws whole quantities (as a `JointLaw`), and not each entry independently."""
        return False

    @property
    def own(self) -> Any:
        """The user's object that defines the distribution, if `to_dict` does not contain all of it; else None."""
        return None

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        """Problem with drawing quantities of these shapes, and its remedy; None if there is no problem."""
        if len(shapes) != 1:
            return f"is of one quantity, and there are {len(shapes)}", "give each a distribution"
        (shape,) = shapes
        try:
            numbers = self.numbers_by_name().values() if self.by_component else ()
            fits = np.broadcast_shapes(shape, *map(np.shape, numbers)) == shape
        except ValueError:
            fits = False
        if fits:
            return None
        wanted = f"one number or {' x '.join(map(str, shape))}, one per component" if shape else "one number"
        return f"does not fit a quantity of shape {shape}", f"give {wanted}"

    def ordered_as(self, labels: Sequence[str]) -> Distribution:
        """The distribution with its numbers in the order of the quantities' labels, if it names these itself."""
        return self

    def nothing_of(self, bases: Sequence[np.ndarray]) -> str | None:
        """Name of a width relative to a scene's value of 0, so that nothing varies; else None."""
        return varies_nothing(self, bases)

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Values (n, *shape) at levels u in (0, 1), (n, *shape). All distributions of single numbers must define this."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def to_dict(self) -> dict[str, Any]:
        """Convert to the form of a scene file, { normal = { std = ... } }, with the given numbers."""
        return {self.kind: {key: np.asarray(value).tolist() for key, value in self.numbers_by_name().items()}}


def ordered(low: np.ndarray, high: np.ndarray) -> bool:
    """True if low < high in every component; False if the shapes do not fit each other."""
    try:
        return bool(np.all(low < high))
    except ValueError:
        return False


def varies_nothing(distribution: Distribution, bases: Sequence[np.ndarray]) -> str | None:
    """Name of a width relative to a scene's value of 0, so that nothing varies; None if the distribution does vary it."""
    if any(np.any(base) for base in bases):
        return None
    relative = getattr(distribution, "relative", None)
    if relative is not None and np.any(relative):
        return "relative"
    has_sigma = isinstance(distribution, LogNormal) and distribution.median is None and np.any(distribution.sigma)
    return "sigma" if has_sigma else None


def floats(values: Any) -> np.ndarray:
    """Convert checked numbers to float64, including integers of any size."""
    return np.asarray(values, dtype=np.float64)


def _width(std: Spread | None, relative: Spread | None, base: np.ndarray) -> np.ndarray:
    """The absolute spread, given directly or as a fraction of the scene's value."""
    return floats(std) if std is not None else np.abs(base) * floats(relative)


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution, by default about the scene's value.

    Args:
        std: Standard deviation, in the unit of the quantity.
        relative: Standard deviation as a fraction of the scene's value; instead of `std`.
        mean: Mean, in the unit of the quantity; by default the scene's value.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> fleet.parameters(0, 8)["vehicle.buoyancy"].round(1)
        array([308.3, 306.5, 308.7, 309.8, 308.3, 306.9, 307.5, 308.3])
    """

    std: Spread | None = None
    relative: Spread | None = None
    mean: Spread | None = None
    kind: ClassVar[str] = "normal"
    widths: ClassVar[tuple[str, ...]] = ("std", "relative")

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # Values mean + std * Phi^-1(u).
        from scipy.special import ndtri

        mean = base if self.mean is None else floats(self.mean)
        return mean + _width(self.std, self.relative, base) * ndtri(u)


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution: between two ends, or about the scene's value.

    Args:
        low: Lower end, in the unit of the quantity; requires `high`.
        high: Upper end; requires `low`.
        half_width: Largest distance from the scene's value; instead of `low` and `high`.
        relative: Largest distance from the scene's value, as a fraction of this value; instead of `half_width`.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=4, vary={"vehicle.buoyancy": lw.distributions.Uniform(half_width=1.0)})
        >>> fleet.parameters(0, 4)["vehicle.buoyancy"].round(1)
        array([308.3, 307.1, 308.5, 308.9])
    """

    low: Spread | None = None
    high: Spread | None = None
    half_width: Spread | None = None
    relative: Spread | None = None
    kind: ClassVar[str] = "uniform"
    widths: ClassVar[tuple[str, ...]] = ("high", "half_width", "relative")

    def _check_more(self, faults: Faults) -> None:
        if self.low is not None and self.high is None:
            faults.add("low", self.low, "is given without high", "give both, or half_width, or relative")
        if self.high is not None and self.low is None:
            faults.add("high", self.high, "is given without low", "give both, or half_width, or relative")

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # Values low + (high - low) u, or the same about the scene's value.
        if self.high is not None:
            return floats(self.low) + (floats(self.high) - floats(self.low)) * u
        return base + _width(self.half_width, self.relative, base) * (2.0 * u - 1.0)


@dataclass(frozen=True)
class LogNormal(Distribution):
    """Log-normal distribution: median * exp(sigma Z), Z standard normal. Values have the sign of the median.

    Args:
        sigma: Standard deviation of the logarithm of (value / median).
        median: Median; by default the scene's value.
    """

    sigma: Spread | None = None
    median: Spread | None = None
    kind: ClassVar[str] = "lognormal"
    widths: ClassVar[tuple[str, ...]] = ("sigma",)

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # Values median * exp(sigma * Phi^-1(u)).
        from scipy.special import ndtri

        median = base if self.median is None else floats(self.median)
        with np.errstate(over="ignore"):  # the ensemble refuses what is too large, or the run marks it
            return median * np.exp(floats(self.sigma) * ndtri(u))


@dataclass(frozen=True)
class TruncatedNormal(Distribution):
    """Normal distribution restricted to an interval.

    Args:
        std: Standard deviation of the normal distribution before truncation, in the unit of the quantity.
        relative: Standard deviation as a fraction of the scene's value; instead of `std`.
        mean: Mean of the normal distribution before truncation; by default the scene's value.
        low: Lower bound; by default none.
        high: Upper bound; by default none.
        width: Distance of both bounds from the mean, in standard deviations; 3 by default if no bound is given.
    """

    std: Spread | None = None
    relative: Spread | None = None
    mean: Spread | None = None
    low: Spread | None = None
    high: Spread | None = None
    width: Spread | None = None
    kind: ClassVar[str] = "truncated_normal"
    widths: ClassVar[tuple[str, ...]] = ("std", "relative")

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # Normal quantiles at levels between those of the bounds; upper tails by symmetry, which keeps their digits.
        from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp

        mean = base if self.mean is None else floats(self.mean)
        std = _width(self.std, self.relative, base)
        scale = np.where(std > 0.0, std, 1.0)
        low, high, width = self._bounds()
        a = np.maximum((low - mean) / scale, -width)
        b = np.minimum((high - mean) / scale, width)
        flip = a > 0.0
        a, b = np.where(flip, -b, a), np.where(flip, -a, b)
        u = np.where(flip, 1.0 - u, u)
        z = ndtri(ndtr(a) + (ndtr(b) - ndtr(a)) * u)
        if np.any(b < FAR):
            with np.errstate(divide="ignore"):
                level = np.logaddexp(log_ndtr(a) + np.log1p(-u), log_ndtr(b) + np.log(u))
            z = np.where(b < FAR, ndtri_exp(level), z)
        z = np.clip(z, a, b)
        return np.clip(mean + std * np.where(flip, -z, z), low, high)

    def _check_more(self, faults: Faults) -> None:
        if self.width is not None and (self.low is not None or self.high is not None):
            faults.add("width", self.width, "is given with low or high", "keep either width or the bounds")

    def _bounds(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bounds low, high and width; infinite if not given, but width is 3 if none is given."""
        width = 3.0 if self.width is None and self.low is None and self.high is None else self.width
        open_ended = ((self.low, -np.inf), (self.high, np.inf), (width, np.inf))
        low, high, width = (floats(default if value is None else value) for value, default in open_ended)
        return low, high, width


@dataclass(frozen=True)
class Choice(Distribution):
    """Discrete distribution: one of k values, with probabilities proportional to weights.

    Args:
        values: Numbers (k,), from which each entry of the quantity independently gets one; or values (k, *shape), from
            which the whole quantity gets one.
        weights: Weights of the k values, (k,), at least 0; equal by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> speed = lw.distributions.Choice([1.0, 1.5], weights=[1, 3])
        >>> fleet = lw.Ensemble(scene, members=8, vary={"start.velocity[0]": speed})
        >>> fleet.select(0, 8).velocity[:, 0]
        array([1.5, 1. , 1.5, 1.5, 1.5, 1.5, 1.5, 1.5])
    """

    values: Any = ()
    weights: Any = None
    kind: ClassVar[str] = "choice"
    by_component: ClassVar[bool] = False

    def _check_more(self, faults: Faults) -> None:
        try:
            values = np.array(self.values, dtype=np.float64)
            weights = np.ones(len(values)) if self.weights is None else np.array(self.weights, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            return  # a fault for numbers that are not numeric is there already
        if values.ndim == 0 or not len(values):
            faults.add("values", self.values, "is not a list of values", "give one value or more")
        elif weights.shape != values.shape[:1] or not weights.sum() > 0.0:
            fault = f"does not weigh {len(values)} values"
            faults.add("weights", self.weights, fault, "give one from 0 for each value")

    @property
    def joint(self) -> bool:
        return np.ndim(self.values) > 1

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        if not self.joint:
            return super().fault(shapes)
        shape = np.shape(self.values)[1:]
        if len(shapes) == 1 and shape == shapes[0]:
            return None
        return f"has values of shape {shape}", f"give values of shape {shapes[0]}"

    def size(self, bases: Sequence[np.ndarray]) -> int:
        """Number of uniform numbers for one draw: always 1, since one number selects a value of the whole quantity.

        Args:
            bases: The scene's value of the quantity.

        Returns:
            The number 1.
        """
        return 1

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Draw values of the whole quantity.

        Args:
            u: Levels (n, 1) in (0, 1), for n members.
            bases: The scene's value of the quantity, as the only entry.

        Returns:
            Values (n, *shape), as the only entry.
        """
        return [self.quantile(u[:, 0], bases[0])]

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # The value whose part of (0, 1), in proportion to its weight, contains u.
        values = floats(self.values)
        weights = np.ones(len(values)) if self.weights is None else floats(self.weights)
        ends = np.cumsum(weights)[:-1] / weights.sum()
        return values[np.searchsorted(ends, u, side="right")]
