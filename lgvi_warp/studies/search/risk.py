# SPDX-License-Identifier: Apache-2.0
"""Risks: one cost of many members."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, brief


@dataclass(frozen=True)
class CVaR:
    """The mean of the worst part of the members (Rockafellar & Uryasev 2000).

    Args:
        share: The part, in (0, 1]; 0.05 for the worst 5 %. Where it ends within a member, that member counts in part.

    Raises:
        SceneError: If the share is not in (0, 1].
    """

    share: float = 0.05

    def __post_init__(self) -> None:
        faults = Faults("CVaR.")
        share = faults.number("share", self.share)
        if share is not None and not 0.0 < share <= 1.0:
            faults.add("share", self.share, "is no part", "give a number in (0, 1], such as 0.05")
        faults.raise_if_any()

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        """The risk.

        costs: (k, members).
        Returns: (k,); infinite where a member of the worst part has an infinite cost.
        """
        n = costs.shape[1]
        worst = -np.sort(-costs, axis=1)
        weights = np.clip(self.share * n - np.arange(n), 0.0, 1.0)
        counted = weights > 0.0
        return np.asarray(worst[:, counted] @ weights[counted] / weights.sum())

    def __str__(self) -> str:
        return f"mean of the worst {100.0 * self.share:g} %"


@dataclass(frozen=True)
class _Mean:
    def __call__(self, costs: np.ndarray) -> np.ndarray:
        return np.asarray(costs.mean(axis=1))

    def __str__(self) -> str:
        return "mean"


@dataclass(frozen=True)
class _Quantile:
    level: float

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        return np.asarray(np.quantile(costs, self.level, axis=1, method="inverted_cdf"))

    def __str__(self) -> str:
        return f"{100.0 * self.level:g} % quantile"


def risk_of(faults: Faults, risk: Any) -> Any:
    """Read a risk.

    risk: "mean", the level of a quantile in (0, 1), or a `CVaR`.
    Returns: The risk, a function of costs (k, members); the mean where it is at fault.
    """
    if isinstance(risk, CVaR):
        return risk
    if isinstance(risk, float) and 0.0 < risk < 1.0:
        return _Quantile(risk)
    if not (isinstance(risk, str) and risk == "mean"):
        faults.add("risk", brief(risk), "is no risk", 'give "mean", a level such as 0.95, or lw.metrics.CVaR(0.05)')
    return _Mean()
