# SPDX-License-Identifier: Apache-2.0
"""Gaussian copulas: several correlated numbers, each with its own distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.sampling.distributions.joint import JointLaw, combined, components, covariance_of, normals, root, split
from lgvi_warp.sampling.distributions.named import as_distribution


@dataclass(frozen=True, eq=False)
class Copula(JointLaw):
    """Joint distribution of d numbers, each with its own distribution, correlated by a Gaussian copula.

    The numbers are the entries of a vector, or of several quantities with the key "a, b" in `vary`.

    Args:
        correlation: Correlation (d, d) of the normal scores. If the distributions are not normal, the correlation of
            the numbers is slightly closer to 0. A Spearman rank correlation s corresponds to 2 sin(pi s / 6), and a
            Kendall rank correlation t to sin(pi t / 2).
        marginals: Distribution of each number: a list in the order of the names, or a mapping of names to
            distributions. A distribution may be one of lgvi_warp, a frozen distribution of scipy.stats, or an object
            with a quantile function `ppf` or `icdf`.

    Raises:
        SceneError: If the matrix is not a correlation matrix, or a marginal is not a distribution of a single number.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> marginals = [lw.distributions.LogNormal(sigma=0.2), lw.distributions.Uniform(low=300.0, high=312.0)]
        >>> law = lw.distributions.Copula([[1.0, 0.8], [0.8, 1.0]], marginals)
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=1000, vary={"start.velocity[0], vehicle.buoyancy": law})
        >>> members = fleet.select(0, 1000)
        >>> print(f"{np.corrcoef(members.velocity[:, 0], members.parameters['vehicle.buoyancy'])[0, 1]:.1f}")
        0.8
    """

    correlation: Any = None
    marginals: Any = ()
    kind: ClassVar[str] = "copula"
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults(f"{self.kind}.")
        marginals: Any = self.marginals if isinstance(self.marginals, Mapping) else items_of(self.marginals)
        if not marginals:
            remedy = "give [lw.distributions.Normal(...), ...], or a mapping of names to distributions"
            faults.add("marginals", marginals, "are no list of distributions", remedy)
            faults.raise_if_any()
        named = isinstance(marginals, Mapping)
        places = list(marginals) if named else [str(i) for i in range(len(marginals))]
        laws = []
        for place, value in zip(places, marginals.values() if named else marginals, strict=True):
            with faults.including():
                law = as_distribution(f"{self.kind}.marginals.{place}", value)
                if not isinstance(law, Distribution) or law.joint:
                    remedy = "give one of a single number, such as lw.distributions.Normal(...)"
                    faults.add(f"marginals.{place}", value, "is not a distribution of a single number", remedy)
                laws.append(law)
        matrix = covariance_of(faults, SimpleNamespace(std=1.0, correlation=self.correlation), None)
        if matrix is not None and len(matrix) != len(marginals):
            d = len(marginals)
            faults.add("correlation", self.correlation, f"does not fit {d} marginals", f"give {d} x {d} numbers")
        faults.raise_if_any()
        object.__setattr__(self, "marginals", dict(zip(places, laws, strict=True)) if named else tuple(laws))
        object.__setattr__(self, "_root", root(np.asarray(matrix)))

    @property
    def _laws(self) -> tuple[Distribution, ...]:
        return tuple(self.marginals.values() if isinstance(self.marginals, Mapping) else self.marginals)

    def ordered_as(self, labels: Sequence[str]) -> Copula:
        if not isinstance(self.marginals, Mapping):
            return self
        names = [name.replace(" ", "") for name in self.marginals]
        wanted = [label.replace(" ", "") for label in labels]
        if sorted(names) != sorted(wanted):
            faults, known = Faults(f"{self.kind}."), ", ".join(self.marginals)
            faults.add(
                "marginals", known, f"are not of what varies, {', '.join(labels)}", "name the same numbers in both"
            )
            faults.raise_if_any()
        places = [names.index(label) for label in wanted]
        return replace(self, correlation=np.asarray(self.correlation)[np.ix_(places, places)],
                       marginals=[self._laws[i] for i in places])  # fmt: skip

    @property
    def own(self) -> Any:
        objects = tuple(law.own for law in self._laws if law.own is not None)
        return objects or None

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        d, named = len(self._laws), components(shapes)
        if d != named:
            return f"has {d} marginals, and {named} numbers are named", "give one for each number"
        return next((wrong for law in self._laws if (wrong := law.fault([()])) is not None), None)

    def nothing_of(self, bases: Sequence[np.ndarray]) -> str | None:
        entries = np.concatenate([np.ravel(base) for base in bases])
        each = (law.nothing_of([entry]) for law, entry in zip(self._laws, entries, strict=True))
        return next((width for width in each if width), None)

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number for each entry.
        return len(self._laws)

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        from scipy.special import ndtr

        scores = combined(self._root, normals(u))  # type: ignore[attr-defined]
        levels = np.clip(ndtr(scores), 2.0**-54, 1.0 - 2.0**-53)
        entries = np.concatenate([np.ravel(base) for base in bases])
        drawn = [law.quantile(levels[:, i], entries[i]) for i, law in enumerate(self._laws)]
        return split(np.stack(drawn, axis=1), bases)

    def to_dict(self) -> dict[str, Any]:
        laws = self.marginals
        tables = {name: law.to_dict() for name, law in laws.items()} if isinstance(laws, Mapping) else [
            law.to_dict() for law in laws
        ]  # fmt: skip
        return {self.kind: {"correlation": np.asarray(self.correlation).tolist(), "marginals": tables}}
