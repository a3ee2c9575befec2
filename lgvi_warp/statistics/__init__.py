"""Statistics over members, gathered while a run goes: one module for each kind, a table of them for scene files."""

from __future__ import annotations

from lgvi_warp.statistics.angles import CircularMean, MeanAttitude
from lgvi_warp.statistics.base import TYPES, Statistic, from_list
from lgvi_warp.statistics.counts import Exceedance, FirstPassage, Histogram
from lgvi_warp.statistics.estimate import Estimate, Estimates
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.order import Extremes, Quantiles
from lgvi_warp.statistics.outcomes import EndTime, Outcome
from lgvi_warp.statistics.path import PathMaximum, PathMean, PathMinimum, PathRange, PathRms, PathTime
from lgvi_warp.statistics.quantity import Quantity

__all__ = [
    "TYPES",
    "CircularMean",
    "Covariance",
    "EndTime",
    "Estimate",
    "Estimates",
    "Exceedance",
    "Extremes",
    "FirstPassage",
    "Histogram",
    "Mean",
    "MeanAttitude",
    "Outcome",
    "PathMaximum",
    "PathMean",
    "PathMinimum",
    "PathRange",
    "PathRms",
    "PathTime",
    "Quantiles",
    "Quantity",
    "Statistic",
    "from_list",
]
