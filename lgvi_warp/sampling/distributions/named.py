# SPDX-License-Identifier: Apache-2.0
"""All distributions by their names in scene files, and distributions of scipy.stats."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.identity import is_library
from lgvi_warp.common.real_numbers import real_results
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.sampling.distributions.joint import CorrelatedNormal

# Name in a scene file -> name in scipy.stats; shape parameters, loc and scale are named as there.
SCIPY = {
    "beta": "beta",
    "exponential": "expon",
    "gamma": "gamma",
    "gumbel": "gumbel_r",
    "student_t": "t",
    "triangular": "triang",
    "weibull": "weibull_min",
}

# A place in memory, in the text of an object that says nothing else of itself.
ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


@dataclass(frozen=True, eq=False)
class ScipyDistribution(Distribution):
    """A frozen distribution of scipy.stats: lw.distributions.ScipyDistribution(scipy.stats.gamma(2.0, scale=3.0)).

    `vary` also accepts the frozen distribution itself. The values are absolute: the scene's own value is not used.

    Args:
        distribution: The frozen distribution; each parameter is one number, or one number per component.

    Raises:
        SceneError: If the distribution is not frozen, has no quantiles, or scipy refuses its parameters.
    """

    distribution: Any = None
    kind: ClassVar[str] = "scipy"

    def __post_init__(self) -> None:
        faults = Faults()
        if (unfrozen := name_of_unfrozen(self.distribution)) is not None:
            faults.add("distribution", f"scipy.stats.{unfrozen}", *without_numbers(self.distribution))
        elif not is_frozen(self.distribution):
            faults.add("distribution", self.distribution, "is not a frozen distribution of scipy.stats",
                       "give one with its numbers, such as scipy.stats.gamma(2.0, scale=3.0)")  # fmt: skip
        elif not all([faults.finite(name, value) is not None for name, value in self.numbers_by_name().items()]):
            pass
        elif not np.all(np.isfinite(self.distribution.ppf(0.5))):
            fault = "are numbers that scipy.stats refuses"
            faults.add(self.name, self._numbers(), fault, "see its page for their limits")
        faults.raise_if_any()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ScipyDistribution) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.name)

    @property
    def name(self) -> str:
        """The distribution's name in scipy.stats."""
        return str(getattr(self.distribution.dist, "name", None) or type(self.distribution.dist).__name__)

    def numbers_by_name(self) -> dict[str, Any]:
        # The parameters by their names in scipy.stats, as they were given.
        known = [*_shapes(self.distribution.dist), "loc", "scale"]
        return dict(zip(known, self.distribution.args, strict=False)) | dict(self.distribution.kwds)

    def _numbers(self) -> dict[str, Any]:
        """The parameters as lists; without any parameter loc = 0, so that a file contains a number."""
        parameters = self.numbers_by_name() or {"loc": 0.0}
        return {name: np.asarray(value).tolist() for name, value in parameters.items()}

    @property
    def own(self) -> Any:
        # The frozen distribution, unless it is one of scipy's, which its name and numbers tell.
        return None if is_library(type(self.distribution.dist).__module__) else self.distribution

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        return np.asarray(self.distribution.ppf(u), dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        # { gamma = { a = 2.0, scale = 3.0 } }, or { scipy = { name = "...", ... } } where a scene file has no name for it.
        file_names = {name: kind for kind, name in SCIPY.items()}
        if self.name in file_names:
            return {file_names[self.name]: self._numbers()}
        return {"scipy": {"name": self.name} | self._numbers()}

    @classmethod
    def from_table(cls, key: str, kind: str, values: Mapping[str, Any]) -> ScipyDistribution:
        """Build a distribution from the dict of `to_dict`.

        Args:
            key: Name of the varied quantity, for error messages.
            kind: Name of the distribution in a scene file, or "scipy" for any distribution of scipy.stats.
            values: Parameters by name; for "scipy" also the distribution's name in scipy.stats.

        Returns:
            The distribution.

        Raises:
            SceneError: If the name or a number is wrong. The message lists every fault.
        """
        from scipy import stats

        name = SCIPY.get(kind, values.get("name"))
        distribution = getattr(stats, name, None) if isinstance(name, str) else None
        if not isinstance(distribution, stats.rv_continuous | stats.rv_discrete):
            fault = "is not a distribution of scipy.stats"
            raise refusal(f"{key}.{kind}.name", name, fault, 'give its name, such as "gamma"')
        faults, shapes, known = Faults(), _shapes(distribution), _numbers_of(distribution)
        parameters = {parameter: value for parameter, value in values.items() if kind in SCIPY or parameter != "name"}
        faults.keys(f"{key}.{kind}", parameters, known)
        for parameter in shapes:
            if parameter not in parameters:
                remedy = f"scipy.stats.{name} takes {', '.join(known)}"
                faults.add(f"{key}.{kind}.{parameter}", None, "is missing", remedy)
        if not parameters and not shapes:
            faults.add(f"{key}.{kind}", dict(values), "has no numbers", f"give one or more of {', '.join(known)}")
        for parameter, value in parameters.items():
            faults.finite(f"{key}.{kind}.{parameter}", value)
        faults.raise_if_any()
        try:
            return cls(distribution(**{parameter: np.asarray(value)[()] for parameter, value in parameters.items()}))
        except SceneError as error:
            raise error.prefixed(f"{key}.{kind}: ") from None


@dataclass(frozen=True, eq=False)
class BinnedDistribution(Distribution):
    """Distribution given by a histogram, uniform within each bin.

    Its values are absolute: the scene's own value is not used. It is "histogram" in a scene file and
    scipy.stats.rv_histogram in `vary`; lw.statistics.Histogram is the statistic.

    Args:
        counts: Weights of the bins, (k,), at least 0, on any scale.
        edges: Edges of the bins, (k + 1,), rising, in the unit of the quantity.
    """

    counts: Any = ()
    edges: Any = ()
    kind: ClassVar[str] = "histogram"
    by_component: ClassVar[bool] = False

    def _check_more(self, faults: Faults) -> None:
        counts, edges = (faults.finite(name, getattr(self, name)) for name in ("counts", "edges"))
        if counts is None or edges is None:
            return
        if counts.ndim != 1 or not counts.size or not counts.sum() > 0.0:
            faults.add("counts", self.counts, "weigh no bin", "give one from 0 for each bin, not all of them 0")
        elif edges.shape != (len(counts) + 1,) or np.any(np.diff(edges) <= 0.0):
            faults.add("edges", self.edges, f"do not bound {len(counts)} bins", "give one more than counts, rising")

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        # Values linear in the level within each bin.
        counts = np.asarray(self.counts, dtype=np.float64)
        levels = np.concatenate([[0.0], np.cumsum(counts)]) / counts.sum()
        return np.interp(u, levels, np.asarray(self.edges, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class UserDistribution(Distribution):
    """A distribution given by a user's object with quantiles: ppf(u), or icdf(u) as in scipy's new distributions.

    The values are absolute. A file stores only text, so a run that is read from a file needs the ensemble again.

    Args:
        distribution: The object.

    Raises:
        SceneError: If the object does not give finite numbers at the levels 0.25 and 0.75.
    """

    distribution: Any = None
    kind: ClassVar[str] = "own"
    by_component: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if (unfrozen := name_of_unfrozen(self.distribution)) is not None:
            raise refusal("distribution", f"scipy.stats.{unfrozen}", *without_numbers(self.distribution))
        try:
            usable = bool(np.all(np.isfinite(self._quantiles(np.array([0.25, 0.75])))))
        except Exception:  # whatever a user's object raises
            usable = False
        if not usable:
            fault = "gives no numbers at the levels 0.25 and 0.75"
            raise refusal("distribution", self.distribution, fault, "give an object with ppf(u)")

    @property
    def own(self) -> Any:
        # The object, unless it is a library's whose text tells which it is.
        told_by_text = is_library(type(self.distribution).__module__) and not ADDRESS.search(str(self.distribution))
        return None if told_by_text else self.distribution

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        return self._quantiles(u)

    def _quantiles(self, u: np.ndarray) -> np.ndarray:
        return real_results(quantiles_of(self.distribution)(u)).astype(np.float64)

    def to_dict(self) -> dict[str, Any]:
        # Its text without the memory address, so that the same distribution always gives the same provenance.
        return {self.kind: {"law": ADDRESS.sub("", str(self.distribution))}}


def quantiles_of(distribution: Any) -> Any:
    """The quantile function of an object, its method ppf or icdf; None if it has neither."""
    function = getattr(distribution, "ppf", None) or getattr(distribution, "icdf", None)
    return function if callable(function) else None


KINDS = Distribution.kinds
# Those of which a file has the text alone.
IN_MEMORY = (UserDistribution.kind, "openturns", "derived")
# Methods by which a distribution of OpenTURNS is known.
OPENTURNS = ("computeQuantile", "getMarginal", "getDimension")


def is_frozen(value: Any) -> bool:
    """True if an object is a frozen distribution of scipy.stats; this does not import scipy."""
    return all(hasattr(value, name) for name in ("dist", "args", "kwds", "ppf"))


def name_of_unfrozen(value: Any) -> str | None:
    """Name of a distribution of scipy.stats without numbers, such as scipy.stats.norm; else None."""
    known = sys.modules.get("scipy.stats")
    name = getattr(value, "name", None)
    return name if isinstance(name, str) and known is not None and getattr(known, name, None) is value else None


def without_numbers(value: Any) -> tuple[str, str]:
    """The fault of a distribution of scipy.stats without numbers."""
    numbers = ", ".join(f"{name}=..." for name in _numbers_of(value))
    remedy = f"give them: scipy.stats.{value.name}({numbers})"
    return "is not a frozen distribution of scipy.stats: it has no numbers", remedy


def _shapes(distribution: Any) -> list[str]:
    """Names of the shape parameters of a distribution of scipy.stats."""
    return [name for name in (distribution.shapes or "").replace(" ", "").split(",") if name]


def _numbers_of(distribution: Any) -> list[str]:
    """Names of all parameters of a distribution of scipy.stats."""
    return [*_shapes(distribution), "loc"] + ["scale"] * hasattr(distribution, "pdf")


def as_distribution(key: str, value: Any) -> Any:
    """Turn an entry of `vary` into a distribution, if it is one."""
    if isinstance(value, Distribution | type):
        return value
    if isinstance(value, Mapping):
        return from_dict(key, value)
    parameters = getattr(value, "args", ()) or getattr(value, "kwds", {})
    distribution = getattr(value, "dist", value)
    if type(distribution).__name__ == "rv_histogram" and not parameters:
        edges = distribution._histogram[1]
        return BinnedDistribution(np.diff(distribution.cdf(edges)).tolist(), np.asarray(edges).tolist())
    if is_frozen(value):
        return ScipyDistribution(value)
    if all(callable(getattr(value, name, None)) for name in OPENTURNS):
        from lgvi_warp.sampling.distributions.openturns import OpenTURNSDistribution

        return OpenTURNSDistribution(value)
    if type(value).__name__ == "multivariate_normal_frozen":
        return CorrelatedNormal(covariance=np.asarray(value.cov).tolist(), mean=np.asarray(value.mean).tolist())
    try:
        return UserDistribution(value) if quantiles_of(value) else value
    except SceneError as error:
        raise error.prefixed(f"{key}: ") from None


def from_dict(key: str, content: Any) -> Distribution:
    """Build a distribution from a table of a scene file, { normal = { std = 1.0 } }."""
    if not isinstance(content, Mapping) or len(content) != 1:
        raise refusal(key, content, "is not a distribution", "write { normal = { std = 1.0 } }")
    faults = Faults()
    kind, values = next(iter(content.items()))
    foreign = kind in SCIPY or kind == ScipyDistribution.kind
    if kind in IN_MEMORY:
        what = "holds functions" if kind == "derived" else "is a distribution of your own"
        faults.add(key, values, f"{what}, which a file does not hold", "give the ensemble again")
    elif not foreign and kind not in KINDS:
        faults.keys(key, [kind], [*(name for name in KINDS if name not in IN_MEMORY), *SCIPY])
    elif not isinstance(values, Mapping):
        faults.add(f"{key}.{kind}", values, "is not a table", "write { normal = { std = 1.0 } }")
    elif not foreign and kind != "factor":
        faults.keys(f"{key}.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    if foreign:
        return ScipyDistribution.from_table(key, kind, values)
    try:
        # What stands in a factor is its distribution, under its key `law` or by itself.
        alone = kind == "factor" and list(values) != ["law"]
        distribution: Distribution = KINDS[kind](values) if alone else KINDS[kind](**values)
        return distribution
    except SceneError as error:
        raise error.prefixed(f"{key}: ") from None
