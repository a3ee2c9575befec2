# SPDX-License-Identifier: Apache-2.0
"""Continuation of a run: the state that its packets leave and that the packets of the next run take."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_kernels.advance.beginning import GOES_ON, GOES_ON_WITHOUT_LEAD, STARTS
from lgvi_kernels.advance.events import FIRST
from lgvi_kernels.advance.spec import Spec
from lgvi_warp.common.errors import Faults
from lgvi_warp.engine.arrays import put_rows
from lgvi_warp.engine.packing import name_of
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.sampling.final import MEMORY, Final, joined_rows

# A Plan and Packets, whose modules import this one.
Plan = Any
Packets = Any

# The controller's own rows of the memory.
SIGNALS = f"{MEMORY}signals"
# Heights above the surface.
HEIGHTS = "heights"
# Parts of a Spec that change no state and nothing that is remembered.
BESIDE: dict[str, Any] = dict(
    width=0, shared_rows=False, checked=True, warning_rows=(), energy=False, backward=False, substep=False, control=None
)


def settings_of(plan: Plan) -> dict[str, Any]:
    """Settings that determine states and memory of a plan's packets, in addition to the members' numbers."""
    spec: Spec = plan.spec
    control = spec.control
    parts = list(spec._replace(**BESIDE))
    parts.append((control.parts, control.numbers, control.asked) if control else ())
    method = {name: value for name, value in dataclasses.asdict(plan.method).items() if name != "reason"}
    digest = hashlib.sha256(repr((_named(parts), sorted(method.items(), key=str))).encode()).hexdigest()
    return {"method": plan.method.name, "step": plan.grid.h, "dtype": plan.dtype, "kernel": digest}


def known_settings(plan: Plan) -> dict[str, Any]:
    """Settings that determine states and memory of a plan's runs; computed once."""
    settings: dict[str, Any] = plan.shared("settings of states", {}, lambda numbers: settings_of(plan))
    return settings


def _named(value: Any) -> Any:
    """Replace modules in a part of a Spec by names, since a module's text would contain the path of its file."""
    if isinstance(value, tuple | list):
        return tuple(_named(entry) for entry in value)
    return getattr(value, "__name__", value)


def beginning(plan: Plan) -> int:
    """Kind of start of a plan's first launch (see lgvi_kernels.advance.beginning).

    Members continue exactly if their numbers and the settings of their states are unchanged; otherwise from their states.
    """
    final = plan.ensemble.final
    if final is None:
        return STARTS
    same = "state" in final.lanes and final.settings == known_settings(plan) and _same_numbers(plan, final)
    return GOES_ON if same else GOES_ON_WITHOUT_LEAD


def recalls(plan: Plan) -> bool:
    """Whether members continue from a tick at which the previous run saved all signals that this run gathers."""
    final, launches = plan.ensemble.final, plan.launches
    if final is None or not launches.is_tick(plan.grid.first) or "noted" not in final.lanes:
        return False
    return not plan.layout.noted_bits & ~int(final.lanes["noted"][0, 0])


def _same_numbers(plan: Plan, final: Final) -> bool:
    """Whether the members have the same parameters as in the previous run."""
    now = plan.ensemble.parameters(0, plan.ensemble.members)
    if now.keys() != final.parameters.keys():
        return False
    if any(before.shape[1:] != now[name].shape[1:] for name, before in final.parameters.items()):
        return False
    return all(np.array_equal(np.broadcast_to(before, now[name].shape) if len(before) == 1 else before,
                              np.broadcast_to(now[name], before.shape) if len(before) > 1 else now[name])
               for name, before in final.parameters.items())  # fmt: skip


def begun(plan: Plan) -> Plan:
    """Decide the start of a plan: at t = 0, or from the final states of another run.

    Raises SceneError if that run did not keep the required data.
    """
    final, faults = plan.ensemble.final, Faults("start.")
    if final is None:
        return plan
    plan = replace(plan, launches=replace(plan.launches, begins=beginning(plan), recalls=recalls(plan)))
    needed = FIELDS if not plan.launches.goes_on_exactly else plan.fields
    for name in FIELDS:
        if name in needed and name not in final.states:
            faults.add(name, "...", "was not kept by the run before", f"add {name!r} to its SaveAt(fields=...)")
    codes, known = final.lanes.get("status", np.zeros(1)), FIRST + len(plan.ensemble.scene.events)
    if np.any((codes < 0) | (codes >= known)):
        problem = "has members that an event stopped which the scene does not have"
        faults.add(
            "status", int(np.max(codes)), problem, "go on in the scene of the run before, or with the other members"
        )
    wrong = [name for name, rows in final.lanes.items() if rows.ndim != 2 or len(rows) != final.members]
    if plan.launches.goes_on_exactly and final.lanes["state"].shape != (final.members, plan.spec.state_fields):
        wrong.append("state")
    for name in wrong:
        faults.add(name, final.lanes[name].shape, "is damaged", "run what it is the end of again")
    faults.raise_if_any()
    return _of_same_members(plan, final)


def _of_same_members(plan: Plan, final: Final) -> Plan:
    """Add a message to the plan if its members differ from those of the continued run, or in order."""
    now = plan.ensemble.indices
    if np.array_equal(now, final.indices) or "indices" in plan.ensemble.explicit():  # given: noise that is meant
        return plan
    i = int(np.flatnonzero(now != final.indices)[0])
    same = np.array_equal(np.sort(now), np.sort(final.indices))
    who = "the same members in another order" if same else "other members"
    text = f"start is the end of {who}: member {final.indices[i]} goes on in the place of member {now[i]}"
    text += ". Give final.part(places) in the order of the members"
    return plan if text in plan.grid.messages else replace(plan, grid=plan.grid.telling(text))


def left_by(packets: Packets) -> dict[str, np.ndarray]:
    """Final rows (m, rows) of a block's packets, by name."""
    laws, m = packets.laws, packets.members.count
    memory, half = laws.memory.view, laws.memory.view.shape[1] // 2
    rows = {"state": _by_member(packets.state_lanes.view, m)}
    for name, place in places_of(packets).items():
        if place.stop > place.start:
            rows[name] = _by_member(memory[:, place], m)
    scratch = slice(laws.scratch, half)
    if scratch.stop > scratch.start:
        rows["scratch"] = _by_member(memory[:, scratch], m)
    for name, view in packets.noted.items():
        if view.any():
            rows[name] = _by_member(view if view.ndim == 3 else view[:, None, :], m)
    if packets.bus_rows:
        rows["noted"] = np.full((m, 1), packets.plan.layout.noted_bits)
    bits, values = packets.warned_at_start
    if len(heights := packets.heights.left()):
        rows[HEIGHTS] = heights
    if bits.any():
        rows |= {"start_warnings": bits[:, None], "start_values": values[:, None]}
    return rows


def places_of(packets: Packets) -> dict[str, slice]:
    """Rows of each law, part and event in the memory of some packets; "signals" belong to the controller."""
    choice, laws = packets.plan.kernel_choice, packets.laws
    kinds = ("law", choice.laws), ("part", choice.parts_of_control), ("event", choice.events)
    names = [name_of(kind, term) for kind, each in kinds for term, _ in each]
    places = dict(zip(names, laws.remembered, strict=True))
    return {SIGNALS: slice(0, packets.bus_rows), **places}


def take(packets: Packets, final: Final) -> None:
    """Write the final states of another run into the packets of its members, which are at their starts."""
    exact, memory = packets.plan.launches.goes_on_exactly, packets.laws.memory.view
    half = memory.shape[1] // 2
    lanes = _in_steps(final, packets.plan)
    if exact:
        put_rows(packets.state_lanes.view, lanes["state"])
        if "scratch" in lanes and lanes["scratch"].shape[1] == half - packets.laws.scratch:
            put_rows(memory[:, packets.laws.scratch : half], lanes["scratch"])
    for name, place in places_of(packets).items():
        rows = lanes.get(name)
        if rows is not None:
            count = min(place.stop - place.start, rows.shape[1])
            put_rows(memory[:, place.start : place.start + count], rows[:, :count])
    memory[:, half:] = memory[:, :half]
    for name, view in packets.noted.items():
        if name in lanes and (exact or name in ENDED):
            put_rows(view if view.ndim == 3 else view[:, None, :], lanes[name])


def _in_steps(final: Final, plan: Plan) -> Mapping[str, np.ndarray]:
    """Convert rows that count steps from t = 0 to the steps of the plan, whose step or time may be different."""
    ratio = final.step / plan.grid.h
    shift = plan.grid.first - final.steps * ratio
    if ratio == 1.0 and shift == 0.0:
        return final.lanes
    lanes, controller = dict(final.lanes), plan.kernel_choice.controller
    if "failed_step" in lanes:
        # Of an event the size is the square of the part of its step that was made.
        size = lanes.get("failed_size", np.zeros_like(lanes["failed_step"], dtype=np.float64))
        event = lanes["status"] >= FIRST
        at = (lanes["failed_step"] + np.where(event, np.sqrt(size), 0.0)) * ratio + shift
        steps = np.where(event, np.floor(at), np.rint(at))
        lanes["failed_step"] = steps.astype(lanes["failed_step"].dtype)
        lanes["failed_size"] = np.where(event, (at - steps) ** 2, size)
    if controller is not None and SIGNALS in lanes:
        rows, begin = lanes[SIGNALS].copy(), controller.bus.acting + 2 * controller.bus.channels
        if controller.bus.delayed:
            rows[:, begin] = rows[:, begin] * ratio + shift
        for row in controller.bus.done.values():
            rows[:, row + 1 : row + 2] += shift * plan.grid.h
        lanes[SIGNALS] = rows
    return lanes


# What is noted of members that ended, which stay so whatever else changes.
ENDED = ("status", "failed_step", "failed_size", "still", "substeps")


def start_warnings(final: Final, members: int) -> tuple[np.ndarray, np.ndarray]:
    """Warnings at the start of the run with these final states: (bits, value)."""
    if "start_warnings" not in final.lanes:
        return np.zeros(members, np.uint16), np.zeros(0)
    return final.lanes["start_warnings"][:, 0].astype(np.uint16), final.lanes["start_values"][:, 0]


def _by_member(view: np.ndarray, members: int) -> np.ndarray:
    """Copy lanes (packets, rows, width) to rows by member (members, rows)."""
    packets, rows, width = view.shape
    return np.array(view.transpose(0, 2, 1), order="C").reshape(packets * width, rows)[:members]


def joined(parts: Mapping[int, Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Join the rows of blocks, given by their first member; shorter or missing rows are filled with zeros."""
    ordered = [parts[first] for first in sorted(parts)]
    if len(ordered) == 1:
        return dict(ordered[0])
    return joined_rows(ordered, [len(part["state"]) for part in ordered])
