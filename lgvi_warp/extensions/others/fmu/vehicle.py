# SPDX-License-Identifier: Apache-2.0
"""One vehicle that a caller advances by any number of steps at a time, with results bit-identical to a run."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
import warp as wp

from lgvi_warp.control.signals import row_of
from lgvi_warp.engine.host_callback import write_answer
from lgvi_warp.engine.launches import Launches
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.work import at_start, unpacked
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.request import Request, longest
from lgvi_warp.scene.ensemble import Ensemble

# The signal that follows from another one.
HEADING = "measured_heading"
# A number of a step that no run reaches.
NEVER = 2**31 - 1


class EachLaunch(Launches):
    """Launches that each end with a sample, for any number of steps."""

    @functools.cached_property
    def times(self) -> tuple[Any, Any, Any]:
        """Times as in `Launches`, but with the present launch's step as the only step with a sample."""
        stages, leads, _ = super().times
        return stages, leads, wp.array(np.array([NEVER, NEVER], np.int32), dtype=wp.int32, device="cpu")

    def samples_due(self, k0: int, k1: int) -> tuple[int, int]:
        """Make a sample due after step k1."""
        self.times[2].numpy()[0] = k1
        return 0, int(k1 > k0)


class SteppedVehicle:
    """The first member of a scene, advanced from its start.

    scene: A scene with a [run] step. seed: Seed of its noise. signals: Names of requested signals. changing: Names of numbers
    of the scene that may change during the motion. steps: Number of steps done. values: Present motion and signals by name.
    status: A code of `lw.Status`; an ended vehicle keeps its last state and signals.
    """

    def __init__(self, scene: Any, seed: int, signals: tuple[str, ...], changing: tuple[str, ...] = ()):
        ensemble = Ensemble(scene, 1, seed)
        ensemble = ensemble.in_scene(scene, changing) if changing else ensemble
        # Where the host answers, ticks note all that it may read: no code of the kernel writes signals beside.
        asked = scene.controller is not None and scene.controller.callback is not None
        fields_ = (*FIELDS, *(() if asked else signals))
        request = Request(ensemble, t1=longest(scene, scene.run.step), save=SaveAt(fields=fields_, final=False))
        plan = request.plan()
        plan.compile()
        times = {item.name: getattr(plan.launches, item.name) for item in fields(Launches)}
        self.plan = replace(plan, launches=EachLaunch(**times))
        self.h, self.every = plan.grid.h, plan.launches.every
        self._noted = self._rows(signals if asked else ())
        self._members = ensemble.select(0, 1)
        self._packets = Packets(self.plan, self._members)
        self._aside: Packets | None = None
        self.steps, self.status = 0, 0
        self.values = self._first()

    def _rows(self, signals: tuple[str, ...]) -> dict[str, range]:
        """The rows of the memory in which ticks record signals, by name."""
        layout, controller = self.plan.layout, self.plan.kernel_choice.controller
        firsts = {name: rows.start for name, rows in layout.noted_rows.items()}
        begins = {name: row_of(name, controller.bus, firsts) for name in signals} if controller is not None else {}
        return {name: range(row, row + math.prod(layout.table[name].shape)) for name, row in begins.items()}

    def _read(self) -> dict[str, np.ndarray]:
        """The signals that the last tick recorded."""
        rows, table = self._packets.laws.memory.view[0, :, 0], self.plan.layout.table
        noted = {
            name: rows[place.start : place.stop].astype(np.float64).reshape(table[name].shape)
            for name, place in self._noted.items()
        }
        if HEADING in noted:
            # Which the host computes, as for a function that it asks.
            R = noted["measured_attitude"]
            noted[HEADING] = np.arctan2(R[1, 0], R[0, 0])
        return noted

    def _first(self) -> dict[str, np.ndarray]:
        """Samples and signals at the start."""
        with np.errstate(invalid="ignore", over="ignore"):
            # A launch without steps measures, where the host answers. Else the first tick is a part of the first step.
            asked = self.plan.launches.has_callback
            self._packets.launch(0, 0 if asked else 1)
            values = at_start(self.plan, self._members, self._packets)
            if not asked:
                self._packets.refill(self._members)
        return {name: value[0, 0] for name, value in values.items()} | self._read()

    def change(self, numbers: Mapping[str, float | np.ndarray]) -> None:
        """Set numbers of parts of the controller; they take effect at the next tick."""
        parameters = {name: np.asarray(value, dtype=np.float64)[None] for name, value in numbers.items()}
        self._members = replace(self._members, parameters={**self._members.parameters, **parameters})
        if self._aside is None:
            self._aside = Packets(self.plan, self._members)
        self._aside.refill(self._members)
        self._packets.laws.structs[1].view[...] = self._aside.laws.structs[1].view

    def advance(self, steps: int, commands: np.ndarray) -> None:
        """Advance by `steps` steps with commands (channels,), read at ticks; without channels if a controller acts."""
        last, launches, raw = self.steps + steps, self.plan.launches, np.empty(0)
        with np.errstate(invalid="ignore", over="ignore"):
            while self.steps < last:
                stop = last
                if launches.has_callback and self.every is not None:
                    stop = min(last, (self.steps // self.every + 1) * self.every)
                    if launches.is_tick(self.steps):
                        write_answer(self._packets, commands[None])
                raw = self._packets.advance(self.steps, stop)[:, :1]
                self.steps = stop
            layout = self.plan.layout
            values = unpacked(layout.sizes, raw, self._packets.frame, layout.table)
        self.status = int(self._packets.ended()[0][0])
        # Of a vehicle that ended, ticks note one that rests at the origin.
        signals = {name: self.values[name] for name in self._noted} if self.status else self._read()
        self.values = {name: values[name][0, 0] for name in self.plan.fields} | signals

    def _lanes(self) -> list[np.ndarray]:
        """All arrays that the kernel keeps from launch to launch."""
        packets = self._packets
        return [packets.laws.memory.view, packets.state_lanes.view, *packets.noted.values()]

    def remembered(self) -> dict[str, Any]:
        """The present state of the vehicle, as JSON values."""
        lanes = [view.ravel().tolist() for view in self._lanes()]
        values = {name: value.tolist() for name, value in self.values.items()}
        return {"steps": self.steps, "status": self.status, "lanes": lanes, "values": values}

    def recall(self, state: Mapping[str, Any]) -> None:
        """Restore a state of the vehicle."""
        lanes = self._lanes()
        if [len(given) for given in state["lanes"]] != [view.size for view in lanes]:
            raise ValueError("the state is that of another vehicle: give one of this unit")
        for view, given in zip(lanes, state["lanes"], strict=True):
            view[...] = np.array(given, view.dtype).reshape(view.shape)
        self.steps, self.status = int(state["steps"]), int(state["status"])
        self.values = {name: np.array(value, dtype=np.float64) for name, value in state["values"].items()}
