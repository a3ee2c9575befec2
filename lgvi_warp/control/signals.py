# SPDX-License-Identifier: Apache-2.0
"""The signals of a controller that a run may save beside the motion: shape, unit and meaning of each, by name."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.fields import FIELDS, TABLE, Field

if TYPE_CHECKING:
    from lgvi_warp.control.base import Bus
    from lgvi_warp.control.controller import Controller


class Signal(NamedTuple):
    """A signal, and where the kernel has it; the shape of its field is (1,) where the scene's commands tell the size."""

    field: Field
    group: str
    row: int = 0


# Signals with one number for each command of the scene.
CHANNELS = ("command", "actuator")
_OF_ACTUATORS = (
    Signal(Field("command", (1,), "1", "commands of the actuators, faults included, each in its own unit"), ""),
    Signal(Field("actuator", (1,), "1", "where the actuators are, after delay, fault, limit and lag"), "actuator"),
    Signal(Field("demand", (6,), "N, N m", "demanded wrench X Y Z K M N in body axes"), "demand"),
    Signal(Field("unmet", (6,), "N, N m", "demand that the actuators do not deliver, X Y Z K M N"), ""),
)
# Rows of a measurement and of a reference, as lgvi_kernels/advance/noting.py writes them.
_VECTORS = {"position": 0, "attitude": 3}
_MEASURED = _VECTORS | {"velocity": 12, "water_velocity": 15, "angular_velocity": 18, "depth": 2, "heading": 21}
_WANTED = _VECTORS | {"velocity": 12, "angular_velocity": 15, "depth": 2}
_WANTED |= {"heading": 18, "speed": 19, "angular_acceleration": 20}
_KINDS = TABLE | {
    "water_velocity": replace(TABLE["velocity"], meaning="velocity through the water in body axes"),
    "heading": Field("heading", (), "rad", "heading, from north to east"),
}
_REFERENCE = _KINDS | {
    "velocity": TABLE["velocity_inertial"],
    "angular_velocity": replace(TABLE["angular_velocity"], meaning="angular velocity in axes of the wanted attitude"),
    "speed": replace(TABLE["speed"], meaning="speed ahead through the water"),
    "angular_acceleration": Field(
        "angular_acceleration", (3,), "rad/s^2", "angular acceleration in axes of the wanted attitude"
    ),
}


def _noted(group: str, word: str, kinds: Mapping[str, Field], rows: Mapping[str, int]) -> tuple[Signal, ...]:
    def field(kind: str) -> Field:
        return replace(kinds[kind], name=f"{group}_{kind}", meaning=f"{word} {kinds[kind].meaning}")

    return tuple(Signal(field(kind), group, row) for kind, row in rows.items())


SIGNALS: dict[str, Signal] = {
    signal.field.name: signal
    for signal in (
        *_OF_ACTUATORS,
        *_noted("measured", "measured", _KINDS, _MEASURED),
        *_noted("reference", "wanted", _REFERENCE, _WANTED),
    )
}
# Names of all samples that a run may save, in their order, and of those that a file may hold.
SAVED = (*FIELDS, *SIGNALS)
IN_FILES = (*SAVED, "quaternion_wxyz", "energy")


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Names of samples in the order in which they are saved."""
    wanted = set(names)
    return tuple(name for name in SAVED if name in wanted)


def saved_fields(controller: Controller | None) -> dict[str, Field]:
    """The fields that runs of a scene with this controller, wired, may save."""
    fields = {name: TABLE[name] for name in FIELDS}
    if controller is None or controller.bus is None:
        return fields
    signals = {name: signal.field for name, signal in SIGNALS.items()}
    channels = sum(count for _, count in controller.bus.commands.values())
    return fields | signals | {name: replace(signals[name], shape=(channels,)) for name in CHANNELS}


def has_shape(name: str, shape: tuple[int, ...]) -> bool:
    """Whether numbers of one vehicle at one time may have this shape, in some scene."""
    if name in CHANNELS:
        return len(shape) == 1 and shape[0] > 0
    return shape == (TABLE[name] if name in TABLE else SIGNALS[name].field).shape


def row_of(name: str, bus: Bus, noted: Mapping[str, int]) -> int:
    """The first row of the memory that holds a signal."""
    signal = SIGNALS[name]
    firsts = {"command": 0, "unmet": bus.unmet, "actuator": bus.report}
    return firsts[name] if name in firsts else noted[signal.group] + signal.row


def check_names(faults: Faults, key: str, names: Any) -> None:
    """Add a fault for each name that no sample has."""
    if isinstance(names, str) or not isinstance(names, Collection):
        faults.add(key, names, "is no list of names", 'give one, such as ["position", "attitude"]')
        return
    for name in names:
        faults.choice(key, name, SAVED)


def check_signals(faults: Faults, key: str, names: Iterable[str], controller: Controller | None) -> None:
    """Add a fault for each signal that a scene with this controller does not have."""
    problem = "is a signal of a controller, which this scene has not"
    for name in ordered(names) if controller is None else ():
        if name in SIGNALS:
            faults.add(key, name, problem, "give [controller], or leave it out")
