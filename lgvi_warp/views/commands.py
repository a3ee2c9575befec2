# SPDX-License-Identifier: Apache-2.0
"""Names of a controller's commands: the channels of its actuators with their limits, and its faults."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.control.signals import CHANNELS

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# A limit is drawn where it is at most so many times as large as what is seen: a farther one would flatten the curves.
NEAR = 20.0


class ActuatorChannel(NamedTuple):
    """One channel of an actuator."""

    name: str
    limit: float

    def limits(self, values: np.ndarray) -> tuple[float, ...]:
        """Choose the limits that are drawn with these values."""
        near = self.limit < NEAR * max(np.nanmax(np.abs(values), initial=0.0), 1e-9)
        return (-self.limit, self.limit) if near else ()


class Broken(NamedTuple):
    """A fault of an actuator or sensor, and the time at which it begins for the first member [s]."""

    time: float
    text: str


def channels(result: Result) -> list[ActuatorChannel]:
    """Name the channels of a run's actuators."""
    from lgvi_warp.scene.scene import Scene

    count = next((result.samples[name].shape[-1] for name in CHANNELS if name in result.samples), 0)
    unknown = [ActuatorChannel(f"channel {i}", np.nan) for i in range(count)]
    tables = {key: value for key, value in result.provenance["scene"].items() if key not in ("ensemble", "run")}
    try:
        scene = Scene.from_dict(tables)
    except SceneError:  # laws of a user's own, whose names are not known here
        return unknown
    bus = scene.controller.bus if scene.controller is not None else None
    named: list[ActuatorChannel] = []
    for key, (_, many) in bus.commands.items() if bus else ():
        limit = result.parameters.get(f"{key}.limit", np.full((1, 1), np.nan))
        most = np.broadcast_to(limit.reshape(len(limit), -1).max(axis=0), many)
        named += [ActuatorChannel(f"{key}[{i}]", float(most[i])) for i in range(many)]
    return named if len(named) == count else unknown


def faults(result: Result) -> list[Broken]:
    """List the faults of actuators and sensors that begin during a run."""
    broken = []
    for table in result.provenance["scene"].get("controller", {}).get("faults", ()):
        key = table.get("name") or table["type"]
        names = ("time", "gain", "offset", "until")
        # Results of earlier versions have faults of one kind, which stay.
        numbers = {name: np.atleast_1d(result.parameters.get(f"{key}.{name}", np.inf)) for name in names}
        first, last = (float(end) for end in (numbers["time"].min(), numbers["time"].max()))
        if first <= result.time[-1]:
            gain, offset = (_between(numbers[name]) for name in ("gain", "offset"))
            kind = table.get("kind", "gain")
            kinds = [kind] if isinstance(kind, str) else kind
            change = " or ".join(f"times {gain} plus {offset}" if each == "gain" else each for each in kinds)
            when = f"from {first:g} s" if first == last else f"from {first:g} s, of the last member from {last:g} s"
            when += f", until {_between(numbers['until'])} s" * bool(np.any(np.isfinite(numbers["until"])))
            head = f"fault {key}" if table.get("name") else "fault"
            channel = f"{table['of']}[{table.get('channel', 0)}]"
            broken.append(Broken(first, f"{head}: {channel} {change}, {when}"))
    return sorted(broken)


def _between(values: np.ndarray) -> str:
    """Write the value of a number, or its range over the members."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
