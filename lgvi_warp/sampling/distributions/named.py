"""Every law by its name in a scene file, and those of scipy.stats as they are there."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.real_numbers import real_results
from lgvi_warp.sampling.distributions.basic import Choice, Distribution, LogNormal, Normal, TruncatedNormal, Uniform
from lgvi_warp.sampling.distributions.joint import (
    CorrelatedNormal,
    PhysicalInertia,
    PositiveDefinite,
    RotationNormal,
    UniformRotation,
)

# Name in a scene file -> name in scipy.stats, whose parameters, loc and scale it takes.
SCIPY = {
    "beta": "beta",
    "exponential": "expon",
    "gamma": "gamma",
    "gumbel": "gumbel_r",
    "student_t": "t",
    "triangular": "triang",
    "weibull": "weibull_min",
}


@dataclass(frozen=True, eq=False)
class Frozen(Distribution):
    """A frozen distribution of scipy.stats: lw.Frozen(scipy.stats.gamma(2.0, scale=3.0)), or in `vary` that itself.

    Its values are absolute: the scene's own value plays no part. Its parameters may be one number or one per component.
    Raises SceneError for what has no quantiles.
    """

    distribution: Any = None
    kind: ClassVar[str] = "scipy"

    def __post_init__(self) -> None:
        faults = Faults()
        if (unfrozen := name_of_unfrozen(self.distribution)) is not None:
            faults.add("distribution", f"scipy.stats.{unfrozen}", *without_numbers(self.distribution))
        elif not is_frozen(self.distribution):
            faults.add("distribution", self.distribution, "is no frozen distribution of scipy.stats",
                       "give one with its numbers, such as scipy.stats.gamma(2.0, scale=3.0)")  # fmt: skip
        elif not all([faults.finite(name, value) is not None for name, value in self._given_numbers().items()]):
            pass
        elif not np.all(np.isfinite(self.distribution.ppf(0.5))):
            faults.add(
                self.name, self._numbers(), "are numbers that scipy.stats refuses", "see its page for their limits"
            )
        faults.raise_if_any()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Frozen) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def name(self) -> str:
        """In scipy.stats."""
        return str(getattr(self.distribution.dist, "name", None) or type(self.distribution.dist).__name__)

    def _given_numbers(self) -> dict[str, Any]:
        """By their names in scipy.stats, as they were given."""
        known = [*_shapes(self.distribution.dist), "loc", "scale"]
        return dict(zip(known, self.distribution.args, strict=False)) | dict(self.distribution.kwds)

    def _numbers(self) -> dict[str, Any]:
        """The same as lists; of one that was frozen with none, where it lies, so that a file holds a number."""
        given = self._given_numbers() or {"loc": 0.0}
        return {name: np.asarray(value).tolist() for name, value in given.items()}

    def numbers(self) -> list[Any]:
        """Its parameters."""
        return list(self._numbers().values())

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """scipy's ppf."""
        return np.asarray(self.distribution.ppf(u), dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        """{ gamma = { a = 2.0, scale = 3.0 } }, or { scipy = { name = "...", ... } } of one without a name of its own."""
        own = {name: kind for kind, name in SCIPY.items()}
        if self.name in own:
            return {own[self.name]: self._numbers()}
        return {"scipy": {"name": self.name} | self._numbers()}

    @classmethod
    def from_table(cls, key: str, kind: str, values: Mapping[str, Any]) -> Frozen:
        """From what `to_dict` gives. Raises SceneError naming the key and every fault."""
        from scipy import stats

        faults = Faults()
        name = SCIPY.get(kind, values.get("name"))
        law = getattr(stats, name, None) if isinstance(name, str) else None
        if not isinstance(law, stats.rv_continuous | stats.rv_discrete):
            faults.add(
                f"{key}.{kind}.name", name, "is no distribution of scipy.stats", 'give its name, such as "gamma"'
            )
            faults.raise_if_any()
        assert law is not None
        shapes, known = _shapes(law), _numbers_of(law)
        given = {one: value for one, value in values.items() if kind in SCIPY or one != "name"}
        faults.keys(f"{key}.{kind}", given, known)
        for one in shapes:
            if one not in given:
                faults.add(f"{key}.{kind}.{one}", None, "is missing", f"scipy.stats.{name} takes {', '.join(known)}")
        if not given and not shapes:
            faults.add(f"{key}.{kind}", dict(values), "has no numbers", f"give one or more of {', '.join(known)}")
        for one, value in given.items():
            faults.finite(f"{key}.{kind}.{one}", value)
        faults.raise_if_any()
        try:
            return cls(law(**{one: np.asarray(value)[()] for one, value in given.items()}))
        except SceneError as error:
            raise error.prefixed(f"{key}.{kind}: ") from None


@dataclass(frozen=True, eq=False)
class Histogram(Distribution):
    """Numbers from bins: counts (k,), with any scale, between edges (k + 1,), uniform within each bin.

    Absolute: the scene's own value plays no part. lw.Histogram is the statistic; this law is "histogram" in a scene file, and
    scipy.stats.rv_histogram in `vary`.
    """

    counts: Any = ()
    edges: Any = ()
    kind: ClassVar[str] = "histogram"

    def _check_more(self, faults: Faults) -> None:
        counts, edges = (faults.finite(name, getattr(self, name)) for name in ("counts", "edges"))
        if counts is None or edges is None:
            return
        if counts.ndim != 1 or not counts.size or not counts.sum() > 0.0:
            faults.add("counts", self.counts, "weigh no bin", "give one from 0 for each bin, not all of them 0")
        elif edges.shape != (len(counts) + 1,) or np.any(np.diff(edges) <= 0.0):
            faults.add("edges", self.edges, f"do not bound {len(counts)} bins", "give one more than counts, rising")

    def numbers(self) -> list[Any]:
        """None of them is a component's."""
        return []

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Linear in each bin."""
        counts = np.asarray(self.counts, dtype=np.float64)
        levels = np.concatenate([[0.0], np.cumsum(counts)]) / counts.sum()
        return np.interp(u, levels, np.asarray(self.edges, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class OwnLaw(Distribution):
    """A law by an object of the user's with quantiles: ppf(u), or icdf(u) as scipy's new distributions have.

    Its values are absolute. A file has its words only: what is read from one wants the ensemble again.
    """

    law: Any = None
    kind: ClassVar[str] = "own"

    def __post_init__(self) -> None:
        faults = Faults()
        unfrozen = name_of_unfrozen(self.law)
        if unfrozen is not None:
            faults.add("law", f"scipy.stats.{unfrozen}", *without_numbers(self.law))
            faults.raise_if_any()
        try:
            good = bool(np.all(np.isfinite(self._quantiles(np.array([0.25, 0.75])))))
        except Exception:  # whatever a user's object raises
            good = False
        if not good:
            faults.add("law", self.law, "gives no numbers at the levels 0.25 and 0.75", "give an object with ppf(u)")
        faults.raise_if_any()

    def numbers(self) -> list[Any]:
        """None that are known."""
        return []

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        """The object's."""
        return self._quantiles(u)

    def _quantiles(self, u: np.ndarray) -> np.ndarray:
        return real_results(quantiles_of(self.law)(u)).astype(np.float64)

    def to_dict(self) -> dict[str, Any]:
        """What it says of itself, but for its place in memory: that would make each run another one."""
        return {self.kind: {"law": re.sub(r" at 0x[0-9a-fA-F]+", "", str(self.law))}}


def quantiles_of(law: Any) -> Any:
    """The quantile function of an object, ppf or icdf; None where it has none."""
    found = getattr(law, "ppf", None) or getattr(law, "icdf", None)
    return found if callable(found) else None


KINDS: dict[str, type[Distribution]] = {
    law.kind: law
    for law in (Normal, Uniform, LogNormal, TruncatedNormal, Choice, Histogram, CorrelatedNormal, RotationNormal,
                UniformRotation, PositiveDefinite, PhysicalInertia)
}  # fmt: skip


def is_frozen(value: Any) -> bool:
    """Whether it is a frozen distribution of scipy.stats; without importing that."""
    return all(hasattr(value, name) for name in ("dist", "args", "kwds", "ppf"))


def name_of_unfrozen(value: Any) -> str | None:
    """The name of what scipy.stats holds as a distribution without numbers, such as scipy.stats.norm; None of all else."""
    known = sys.modules.get("scipy.stats")
    name = getattr(value, "name", None)
    return name if isinstance(name, str) and known is not None and getattr(known, name, None) is value else None


def without_numbers(value: Any) -> tuple[str, str]:
    """(what is wrong, the remedy) with such a one."""
    numbers = ", ".join(f"{name}=..." for name in _numbers_of(value))
    return (
        "is no frozen distribution of scipy.stats: it has no numbers",
        f"give them: scipy.stats.{value.name}({numbers})",
    )


def _shapes(law: Any) -> list[str]:
    """Names of the shape parameters of a distribution of scipy.stats."""
    return [name for name in (law.shapes or "").replace(" ", "").split(",") if name]


def _numbers_of(law: Any) -> list[str]:
    """Names of all of its parameters."""
    return [*_shapes(law), "loc"] + ["scale"] * hasattr(law, "pdf")


def as_law(key: str, value: Any) -> Any:
    """What may stand in `vary` as a law: a table, what scipy.stats has, an object with quantiles; all else as it is.

    Raises SceneError for a table that is none.
    """
    if isinstance(value, Distribution | type):
        return value
    if isinstance(value, Mapping):
        return from_dict(key, value)
    given = getattr(value, "args", ()) or getattr(value, "kwds", {})
    whole = getattr(value, "dist", value)
    if type(whole).__name__ == "rv_histogram" and not given:
        edges = whole._histogram[1]
        return Histogram(np.diff(whole.cdf(edges)).tolist(), np.asarray(edges).tolist())
    if is_frozen(value):
        return Frozen(value)
    if type(value).__name__ == "multivariate_normal_frozen":
        return CorrelatedNormal(covariance=np.asarray(value.cov).tolist(), mean=np.asarray(value.mean).tolist())
    try:
        return OwnLaw(value) if quantiles_of(value) else value
    except SceneError as error:
        raise SceneError(f"{key}: {fault}" for fault in error.faults) from None


def from_dict(key: str, content: Any) -> Distribution:
    """A distribution from { normal = { std = 1.0 } }. Raises SceneError naming the key and every fault."""
    faults = Faults()
    if not isinstance(content, Mapping) or len(content) != 1:
        faults.add(key, content, "is not a distribution", "write { normal = { std = 1.0 } }")
        faults.raise_if_any()
    kind, values = next(iter(content.items()))
    foreign = kind in SCIPY or kind == Frozen.kind
    if kind == OwnLaw.kind:
        faults.add(key, values, "is a law of your own, which a file does not hold", "give the ensemble again")
    elif not foreign and kind not in KINDS:
        faults.keys(key, [kind], [*KINDS, *SCIPY, Frozen.kind])
    elif not isinstance(values, Mapping):
        faults.add(f"{key}.{kind}", values, "is not a table", "write { normal = { std = 1.0 } }")
    elif not foreign:
        faults.keys(f"{key}.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    if foreign:
        return Frozen.from_table(key, kind, values)
    try:
        return KINDS[kind](**values)
    except SceneError as error:
        raise error.prefixed(f"{key}: ") from None
