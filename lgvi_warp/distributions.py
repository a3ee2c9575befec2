"""What may vary from member to member: distributions as quantile functions, and uniform numbers keyed by member.

Every distribution maps uniform numbers in (0, 1) to values, so any sampling of the unit cube can feed it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults, SceneError

Spread = float | tuple[float, ...] | list[float] | np.ndarray


def uniforms(seed: int, name: str, first: int, count: int, components: int) -> np.ndarray:
    """Uniform numbers in (0, 1), (count, components), of the members from `first` on.

    They depend on the seed, the member's index and the name only: Philox counters, a fixed number for each member.
    """
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")
    key = np.random.SeedSequence([int(seed), *(int(word) for word in words)]).generate_state(2, np.uint64)
    counters = -(-components // 4)
    generator = np.random.Philox(key=key)
    generator.advance(first * counters)
    raw = generator.random_raw(count * counters * 4).reshape(count, counters * 4)[:, :components]
    return ((raw >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


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
            if array is not None and name not in ("mean", "median", "low", "high") and np.any(array < 0.0):
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
        from scipy.special import ndtr, ndtri

        mean = base if self.mean is None else np.asarray(self.mean)
        std = _width(self.std, self.relative, base)
        scale = np.where(std > 0.0, std, 1.0)
        low, high, width = self._bounds()
        a = np.maximum((low - mean) / scale, -width)
        b = np.minimum((high - mean) / scale, width)
        flip = a > 0.0
        a, b = np.where(flip, -b, a), np.where(flip, -a, b)
        level = ndtr(a) + (ndtr(b) - ndtr(a)) * np.where(flip, 1.0 - u, u)
        z = np.clip(ndtri(level), a, b)
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


KINDS: dict[str, type[Distribution]] = {law.kind: law for law in (Normal, Uniform, LogNormal, TruncatedNormal)}


def from_dict(key: str, content: Any) -> Distribution:
    """A distribution from { normal = { std = 1.0 } }. Raises SceneError naming the key and every fault."""
    faults = Faults()
    if not isinstance(content, Mapping) or len(content) != 1:
        faults.add(key, content, "is not a distribution", "write { normal = { std = 1.0 } }")
        faults.raise_if_any()
    kind, values = next(iter(content.items()))
    if kind not in KINDS:
        faults.keys(key, [kind], KINDS)
    elif not isinstance(values, Mapping):
        faults.add(f"{key}.{kind}", values, "is not a table", "write { normal = { std = 1.0 } }")
    else:
        faults.keys(f"{key}.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    try:
        return KINDS[kind](**values)
    except SceneError as error:
        raise SceneError(f"{key}: {fault}" for fault in error.faults) from None
