# SPDX-License-Identifier: Apache-2.0
"""A plan from the arguments of `solve`."""

from __future__ import annotations

from typing import Any

from lgvi_warp.engine.plan import Plan
from lgvi_warp.runs.request import Request
from lgvi_warp.scene.ensemble import Ensemble


def make_plan(fleet: Ensemble, *arguments: Any, survey_all: bool = True, **settings: Any) -> Plan:
    """Make the plan of a run from its settings, as in `Request`."""
    return Request(fleet, *arguments, **settings).plan(survey_all)
