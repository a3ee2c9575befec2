# SPDX-License-Identifier: Apache-2.0
"""Provenance of a run, and the messages for the user about its settings and starts."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.deferred import Once
from lgvi_warp.engine.keepers.observation import Observation
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.final import NUMBERS
from lgvi_warp.scene import plausibility
from lgvi_warp.scene.ensemble import SURVEYED
from lgvi_warp.scene.functions import functions_of, identities
from lgvi_warp.scene.slices import AT_ONCE


def messages(plan: Plan) -> tuple[str, ...]:
    """List the messages for the user before the run: on times, vehicle, parameters and starts."""
    return plan.grid.messages + tuple(plan.ensemble.scene.vehicle.warnings) + odd_before(plan)


def provenance(plan: Plan, observed: Observation | None = None, fields: Sequence[str] | None = None) -> dict[str, Any]:
    """Everything that determines a result: scene, ensemble, settings, versions and machine."""
    return with_scene(provenance_but_scene(plan, observed, fields))


def with_scene(content: Mapping[str, Any]) -> dict[str, Any]:
    """Build the provenance of a run from the output of `provenance_but_scene`."""
    return {**content, "scene": content["scene"]()}


def when_read(content: Mapping[str, Any]) -> Any:
    """The field `provenance` of a result, which `with_scene` builds at its first use."""
    return functools.partial(with_scene, content)


def provenance_but_scene(
    plan: Plan, observed: Observation | None = None, fields: Sequence[str] | None = None
) -> dict[str, Any]:
    """The provenance with a function in place of the scene's tables: listing all numbers of a field takes seconds."""
    content = {
        "scene": Once(plan.ensemble.scene.to_dict),
        "ensemble": plan.ensemble.to_dict(),
        "method": {
            "name": plan.method.name,
            "solver": plan.method.solver,
            "iterations": plan.method.iterations,
            "tolerance": plan.method.residual_tolerance(plan.dtype),
        }
        | ({"chosen": plan.method.reason} if plan.method.reason else {})
        | ({"alpha": plan.method.alpha, "beta": plan.method.beta} if plan.spec.averages else {})
        | ({"rtol": plan.method.rtol, "atol": plan.method.atol} if plan.method.adaptive else {}),
        "step": plan.grid.h,
        "steps": plan.grid.steps,
        "dtype": plan.dtype,
        "width": plan.spec.width,
        "checks": plan.checks,
        "on_failure": plan.on_failure,
        "terms": [term.type for term, _ in plan.kernel_choice.laws],
        "kernel": plan.kernel.hash,
        "versions": machine.versions(),
        "machine": machine.describe() | {"width_source": plan.width_source},
    }
    functions = identities(functions_of(plan.ensemble, observed.statistics if observed is not None else ()))
    content |= {"functions": functions} if functions else {}
    if plan.ensemble.scene.source:
        content["source"] = dict(plan.ensemble.scene.source)
    content |= starts_at(plan)
    if observed is not None and observed != Observation():
        kept = {} if observed.samples else {"fields": list(plan.fields if fields is None else fields)}
        content["observed"] = observed.to_dict() | kept
    return content


def starts_at(plan: Plan) -> dict[str, Any]:
    """Start of a continued run, for its provenance: empty at t = 0."""
    final, time = plan.ensemble.final, float(plan.grid.times[0])
    if final is None:
        return {"start": {"time": time}} if plan.grid.first else {}
    numbers = {name: getattr(final, name) for name in NUMBERS}
    return {
        "start": {"time": time, "goes_on": "exactly" if plan.launches.goes_on_exactly else "from states"}
        | {"end": numbers}
    }


def at_end(content: dict[str, Any], values: Mapping[str, np.ndarray], members: int, planned: int) -> dict[str, Any]:
    """Add the facts that are known at the end of a run to its provenance.

    values: Fields of the members that ran, by name, each of shape (n,).
    Returns: The provenance, with the mean number of steps for an adaptive method, and with n if the run ended early.
    """
    means = {name: float(values[name].mean()) for name in ("steps_made", "steps_tried") if name in values}
    return content | means | ({"members": members} if members < planned else {})


def odd_before(plan: Plan) -> tuple[str, ...]:
    """List messages on implausible parameters and starts of the members."""
    ensemble = plan.ensemble
    varies = ensemble.starts_vary or bool(ensemble.varied() and plausibility.own_flows(ensemble.scene))
    starts = plausibility.of_start(ensemble.scene, ensemble.select(0, min(AT_ONCE, ensemble.members) if varies else 1))
    most = None if plan.surveyed_all else SURVEYED
    return plan.kernel_choice.odd.messages(ensemble.members, most) + starts.messages(ensemble.members, AT_ONCE)
