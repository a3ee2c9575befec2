"""What may vary from member to member: distributions as quantile functions, and uniform numbers keyed by member.

Every distribution maps uniform numbers in (0, 1) to values, so any sampling of the unit cube can feed it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import FAR

Spread = float | tuple[float, ...] | list[float] | np.ndarray


@dataclass(frozen=True)
class Distribution:
    """A law of a quantity, around the scene's value of it unless the law says otherwise.

    Numbers may be one for all components or one per component. Raises SceneError naming every fault.
    """

    kind: ClassVar[str] = ""
    # Exactly one of these says how wide the law is.
    widths: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        faults = Faults(f"{self.kind}.")
        given = [name for name in self.widths if getattr(self, name) is not None]
        if self.widths and len(given) != 1:
            remedy = f"give one of {', '.join(self.widths)}"
            faults.add(" and ".join(given) or "width", "...", f"{len(given)} given", remedy)
        values = {name: faults.finite(name, value) for name, value in self._given().items()}
        for name, array in values.items():
            if array is not None and name not in ("mean", "median", "low", "high", "values") and np.any(array < 0.0):
                faults.add(name, array, "is negative", "give a spread from 0")
        low, high = values.get("low"), values.get("high")
        if low is not None and high is not None and not ordered(low, high):
            faults.add("low and high", (low.tolist(), high.tolist()), "are not in order", "give low < high")
        self._check_more(faults)
        faults.raise_if_any()

    def _given(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self) if getattr(self, item.name) is not None}

    def _check_more(self, faults: Faults) -> None:
        """Note what else is wrong with this kind of law."""

    def numbers(self) -> list[Any]:
        """The numbers that were given."""
        return list(self._given().values())

    @property
    def joint(self) -> bool:
        """Whether it gives a quantity, or several, as a whole (a `JointLaw`), and not each entry by itself."""
        return False

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        """(what is wrong, the remedy) for quantities of these shapes that it is to draw; None if it fits."""
        (shape,) = shapes
        try:
            good = np.broadcast_shapes(shape, *(np.shape(number) for number in self.numbers())) == shape
        except ValueError:
            good = False
        if good:
            return None
        wanted = f"one number or {' x '.join(map(str, shape))}, one per component" if shape else "one number"
        return f"does not fit a quantity of shape {shape}", f"give {wanted}"

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Values at the levels u (n, *shape) of a quantity whose scene value is base (*shape)."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: { normal = { std = ... } }."""
        return {self.kind: {key: np.asarray(value).tolist() for key, value in self._given().items()}}


def ordered(low: np.ndarray, high: np.ndarray) -> bool:
    """Whether low < high in every component; False where their shapes do not fit each other."""
    try:
        return bool(np.all(low < high))
    except ValueError:
        return False


def varies_nothing(law: Distribution, bases: Sequence[np.ndarray]) -> str | None:
    """Where a law is relative to the scene's value, and that is 0 in every entry: what its width is called; else None."""
    if any(np.any(base) for base in bases):
        return None
    relative = getattr(law, "relative", None)
    if relative is not None and np.any(relative):
        return "relative"
    return "sigma" if isinstance(law, LogNormal) and law.median is None and np.any(law.sigma) else None


def _width(std: Spread | None, relative: Spread | None, base: np.ndarray) -> np.ndarray:
    """Absolute spread, from itself or as a fraction of the scene's value."""
    return np.asarray(std) if std is not None else np.abs(base) * np.asarray(relative)


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal about mean (default: the scene's value), std or relative std (a fraction of the scene's value)."""

    std: Spread | None = None
    relative: Spread | None = None
    mean: Spread | None = None
    kind: ClassVar[str] = "normal"
    widths: ClassVar[tuple[str, ...]] = ("std", "relative")

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """mean + std * Phi^-1(u)."""
        from scipy.special import ndtri

        mean = base if self.mean is None else np.asarray(self.mean)
        return mean + _width(self.std, self.relative, base) * ndtri(u)


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform from low to high, or about the scene's value within half_width, or within relative times it."""

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
        """low + (high - low) u."""
        if self.high is not None:
            return np.asarray(self.low) + (np.asarray(self.high) - np.asarray(self.low)) * u
        return base + _width(self.half_width, self.relative, base) * (2.0 * u - 1.0)


@dataclass(frozen=True)
class LogNormal(Distribution):
    """exp(Normal): median (default: the scene's value) times exp(sigma Z); keeps the sign of the median."""

    sigma: Spread | None = None
    median: Spread | None = None
    kind: ClassVar[str] = "lognormal"
    widths: ClassVar[tuple[str, ...]] = ("sigma",)

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """median * exp(sigma Phi^-1(u))."""
        from scipy.special import ndtri

        median = base if self.median is None else np.asarray(self.median)
        with np.errstate(over="ignore"):  # what is too large is refused by the ensemble, or marked by the run
            return median * np.exp(np.asarray(self.sigma) * ndtri(u))


@dataclass(frozen=True)
class TruncatedNormal(Distribution):
    """Normal kept between low and high (absolute; one alone leaves the other side open), or within `width` standard
    deviations of its mean (default 3).
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
        """The normal's quantile at a level between those of the bounds; upper tails by symmetry, for their digits."""
        from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp

        mean = base if self.mean is None else np.asarray(self.mean)
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
        """low, high, width, infinite where not given; width is 3 if none is."""
        width = 3.0 if self.width is None and self.low is None and self.high is None else self.width
        open_ended = ((self.low, -np.inf), (self.high, np.inf), (width, np.inf))
        low, high, width = (np.asarray(default if value is None else value) for value, default in open_ended)
        return low, high, width


@dataclass(frozen=True)
class Choice(Distribution):
    """One of the values, with chances proportional to the weights (default: equal).

    values (k,): every entry of the quantity gets one of these numbers, each entry by itself; (k, *shape): the quantity gets
    one of these as a whole.
    """

    values: Any = ()
    weights: Any = None
    kind: ClassVar[str] = "choice"

    def _check_more(self, faults: Faults) -> None:
        try:
            values = np.array(self.values, dtype=np.float64)
            weights = np.ones(len(values)) if self.weights is None else np.array(self.weights, dtype=np.float64)
        except (TypeError, ValueError):
            return  # said already: not numeric
        if values.ndim == 0 or not len(values):
            faults.add("values", self.values, "is no list of values", "give one value or more")
        elif weights.shape != values.shape[:1] or not weights.sum() > 0.0:
            faults.add(
                "weights", self.weights, f"does not weigh {len(values)} values", "give one from 0 for each value"
            )

    def numbers(self) -> list[Any]:
        """None of them is a component's."""
        return []

    @property
    def joint(self) -> bool:
        """Whether the values are of the whole quantity."""
        return np.ndim(self.values) > 1

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        """A value of the whole quantity must have its shape."""
        if not self.joint:
            return super().fault(shapes)
        shape = np.shape(self.values)[1:]
        if len(shapes) == 1 and shape == shapes[0]:
            return None
        return f"has values of shape {shape}", f"give values of shape {shapes[0]}"

    def size(self, bases: Sequence[np.ndarray]) -> int:
        """One uniform number chooses a whole value."""
        return 1

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        """A value of the whole quantity at the levels u (n, 1)."""
        return [self.quantile(u[:, 0], bases[0])]

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """The value whose part of (0, 1) holds u."""
        values = np.asarray(self.values, dtype=np.float64)
        weights = np.ones(len(values)) if self.weights is None else np.asarray(self.weights, dtype=np.float64)
        ends = np.cumsum(weights)[:-1] / weights.sum()
        return values[np.searchsorted(ends, u, side="right")]
