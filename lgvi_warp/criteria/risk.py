# SPDX-License-Identifier: Apache-2.0
"""Risk measures: reduce the costs of many members to one number."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, brief


@dataclass(frozen=True)
class CVaR:
    """Conditional value at risk: mean cost of the worst members (Rockafellar & Uryasev 2000).

    Args:
        share: Fraction of the members that count as the worst, in (0, 1]; 0.05 by default, for the worst 5 %. If the
            share is no whole number of members, the least costly of the worst members counts in part.

    Raises:
        SceneError: If the share is not in (0, 1].

    Examples:
        >>> import numpy as np
        >>> import lgvi_warp as lw
        >>> risk = lw.metrics.CVaR(0.5)
        >>> risk(np.array([[4.0, 1.0, 3.0, 2.0]]))
        array([3.5])
    """

    share: float = 0.05

    def __post_init__(self) -> None:
        faults = Faults("CVaR.")
        share = faults.number("share", self.share)
        if share is not None and not 0.0 < share <= 1.0:
            faults.add("share", self.share, "is not a part", "give a number in (0, 1], such as 0.05")
        faults.raise_if_any()

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        """The risk (k,) of costs (k, members); infinite if one of the worst members has an infinite cost.

        docs/theory/estimators.md, (E10).
        """
        n = costs.shape[1]
        worst = -np.sort(-costs, axis=1)
        weights = np.clip(self.share * n - np.arange(n), 0.0, 1.0)
        counted = weights > 0.0
        return np.asarray(worst[:, counted] @ weights[counted] / weights.sum())

    def __str__(self) -> str:
        return f"mean of the worst {100.0 * self.share:g} %"


@dataclass(frozen=True)
class _Risk:
    name: str
    of: Callable[[np.ndarray], Any]

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        return np.asarray(self.of(costs))

    def __str__(self) -> str:
        return self.name


def risk_of(faults: Faults, risk: Any) -> Any:
    """Read a risk: "mean", a quantile's level or a `CVaR`. Returns a function of costs (k, members)."""
    if isinstance(risk, CVaR):
        return risk
    if isinstance(risk, float) and 0.0 < risk < 1.0:
        quantile = functools.partial(np.quantile, q=risk, axis=1, method="inverted_cdf")
        return _Risk(f"{100.0 * risk:g} % quantile", quantile)
    if not (isinstance(risk, str) and risk == "mean"):
        faults.add("risk", brief(risk), "is not a risk", 'give "mean", a level such as 0.95, or lw.metrics.CVaR(0.05)')
    return _Risk("mean", lambda costs: costs.mean(axis=1))
