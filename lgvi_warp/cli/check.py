# SPDX-License-Identifier: Apache-2.0
"""The verb check: validate a scene, and flag implausible values."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from lgvi_warp.cli.output import tell
from lgvi_warp.cli.report import controller_lines
from lgvi_warp.cli.settings import load_scene
from lgvi_warp.cli.verb import add_shared, as_verb


def check_arguments(verb: Any) -> None:
    """Add the arguments of the verb check."""
    add_shared(verb, "scene --method --step --dtype --duration --members --seed --set")


@as_verb(
    "check",
    "validate a scene file and flag implausible values; at most one member is run",
    check_arguments,
    reads=True,
)
def check(chosen: argparse.Namespace) -> int:
    """Run the verb check: print implausible values of a scene; at most one of its members runs."""
    from lgvi_warp.scene import plausibility
    from lgvi_warp.scene.ensemble import Ensemble

    scene = load_scene(chosen)
    ensemble = Ensemble.from_scene(scene)
    head, messages, choice = _settings(ensemble)
    messages += (*scene.vehicle.warnings, *plausibility.of_ensemble(ensemble).messages(ensemble.members))
    end = "can run, with notes: nothing is refused for them" if messages else "can run"
    lines = [f"scene       {chosen.scene}, {head}", *([f"method      {choice}"] if choice else [])]
    lines += controller_lines(scene.to_dict())
    lines += [*(f"note        {text}" for text in messages), f"result      {end}"]
    document = {"scene": chosen.scene, "members": ensemble.members, "method": choice or None, "notes": messages}
    tell(chosen, lambda: document, lambda: "\n".join(lines))
    return 0


def _settings(ensemble: Any) -> tuple[str, tuple[str, ...], str]:
    """Describe the run, messages on its settings, and the choice of its method. Raises SceneError as a run would."""
    from lgvi_warp.runs.default_method import DAMPED, cost
    from lgvi_warp.runs.measured_error import measured_error
    from lgvi_warp.runs.request import Request
    from lgvi_warp.runs.step_error import rates

    run = ensemble.scene.run
    members = f"members {ensemble.members:,}"
    missing = [f"run.{name}" for name in ("step", "duration") if getattr(run, name) is None]
    if missing:
        return members, (f"{' and '.join(missing)}: not given, so the method was not looked at; a run wants it",), ""
    # Automatic iterations are found only by a run.
    method = replace(run.method_of(), iterations=None) if run.iterations == "auto" else None
    plan = Request(ensemble, method).plan()
    name, reason, h = plan.method.name, plan.method.reason, plan.grid.h
    text = cost(plan.method, rates(ensemble), h, measured_error(plan)) if reason and name in DAMPED else ""
    choice = f"{name}, chosen {reason}" + (f": {text}" if text else "") if reason else ""
    return f"{members}, {name}, step {h:g} s, {plan.grid.steps:,} steps", plan.grid.messages, choice
