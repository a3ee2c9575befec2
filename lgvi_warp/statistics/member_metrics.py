# SPDX-License-Identifier: Apache-2.0
"""A metric as one number of each member: read it from a text, a table or a statistic, and look up its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.statistics.base import TYPES, Statistic, from_table
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.paths.member_statistic import MemberStatistic
from lgvi_warp.statistics.paths.member_values import MemberValues
from lgvi_warp.statistics.values.functional import functional


def names_a_statistic(entry: Any) -> bool:
    """True if an entry is a statistic, its table, or a text that begins with its type, such as "overshoot depth"."""
    return isinstance(entry, Statistic | Mapping) or (isinstance(entry, str) and entry.partition(" ")[0] in TYPES)


def metric_of(key: str, entry: Any) -> tuple[str, Statistic]:
    """Name and statistic of one metric that keeps the numbers of all members; "max(depth)" is also a metric."""
    if isinstance(entry, str):
        word, _, of = entry.partition(" ")
        if names_a_statistic(entry):
            entry = {"type": word, **({"of": of} if of else {})}
        elif (quantity := functional(key, entry)).over_path:
            return quantity.label, MemberValues(quantity.label)
        else:
            remedy = 'give "overshoot depth", "iae heading" or "max(depth)"'
            raise refusal(key, entry, "is not one number of each member", remedy)
    statistic = from_table(key, entry)
    if not isinstance(statistic, MemberStatistic):
        remedy = 'give a metric such as lw.metrics.Overshoot("depth"), or "max(depth)"'
        raise refusal(key, statistic.type, "is not a metric: it is not one number of each member", remedy)
    if getattr(statistic, "of", None) is not None:
        size = statistic.quantity.size
        if size != 1 and len(statistic.then_of(np.array([0.0, 1.0]))[0].quantity.labels) != 1:
            raise refusal(key, statistic.key, f"is {size} numbers of each member", "give one component")
    return statistic.key, replace(statistic, then=(MemberValues(),))


def gathered_name(name: str) -> str:
    """Name of a metric's numbers among the statistics of a run."""
    return f"each {name}"


def numbers_of_members(statistics: Mapping[str, Estimate], name: str) -> np.ndarray:
    """A metric's numbers (n,) from the statistics of a run, including failed members; infinite if it is never reached."""
    return np.asarray(statistics[gathered_name(name)].value[0, 0])
