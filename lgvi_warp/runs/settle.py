# SPDX-License-Identifier: Apache-2.0
"""The plan of a run by itself."""

from __future__ import annotations

from typing import Any

from lgvi_warp.engine.plan import Plan
from lgvi_warp.runs.request import Request
from lgvi_warp.scene.ensemble import Ensemble


def make_plan(fleet: Ensemble, *arguments: Any, survey_all: bool = True, **settings: Any) -> Plan:
    """Settle the settings of a run, as in `Request`."""
    return Request(fleet, *arguments, **settings).plan(survey_all)
