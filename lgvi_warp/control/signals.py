# SPDX-License-Identifier: Apache-2.0
"""Quantities that a run may save beside the motion, signals of a controller and the energy used.

Shape, unit and meaning, by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from lgvi_warp.common.arguments import items_of
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


# The one that needs no controller, but a term that keeps the account.
ENERGY_USED = "energy_used"
# Signals with one number for each command of the scene.
CHANNELS = ("command", "actuator")
_OF_ACTUATORS = (
    Signal(Field("command", (1,), "1", "commands of the actuators, faults included, each in its own unit"), ""),
    Signal(Field("actuator", (1,), "1", "where the actuators are, after delay, fault, limit and lag"), "actuator"),
    Signal(Field("demand", (6,), "N, N m", "demanded wrench X Y Z K M N in body axes"), "demand"),
    Signal(Field("exerted", (6,), "N, N m", "wrench that the actuators exert, X Y Z K M N in body axes"), "exerted"),
    Signal(Field("unmet", (6,), "N, N m", "demand that the actuators do not deliver, X Y Z K M N"), ""),
)
# That of parts which solve a problem by iterations.
UNCONVERGED = "unconverged"
_OF_ITERATIONS = Field(
    UNCONVERGED, (), "1", "solutions by iterations that had not converged at their tick, since the start"
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


# Rows of what an estimator believes, as lgvi_kernels/laws/control/error_state_filter.py writes them.
_BLOCKS = "position [m], velocity [m/s], attitude [rad], biases of accelerometer [m/s^2] and gyroscope [rad/s]"
_SLOTS = "four beams [m/s], fix and delayed fix, each three [m], depth [m], heading [rad]"
ESTIMATE = "estimate"
_OF_ESTIMATOR = (
    Signal(
        Field("estimate_sigma", (15,), "1", f"standard deviations that the filter believes: {_BLOCKS}"), ESTIMATE, 0
    ),
    Signal(
        Field("estimate_bias", (6,), "1", "estimated biases of accelerometer [m/s^2] and gyroscope [rad/s]"),
        ESTIMATE,
        15,
    ),
    Signal(Field("nees", (), "1", "e^T P^-1 e of the 15 errors of the estimate, by the truth"), ESTIMATE, 21),
    Signal(Field("nis", (), "1", "sum of the squared innovations over their variances at the last tick"), ESTIMATE, 22),
    Signal(Field("nis_count", (), "1", "how many innovations that are"), ESTIMATE, 23),
    Signal(Field("innovation", (12,), "1", f"innovations of the last tick, 0 where none: {_SLOTS}"), ESTIMATE, 24),
    Signal(
        Field("innovation_sigma", (12,), "1", f"standard deviations that these should have: {_SLOTS}"),
        ESTIMATE,
        36,
    ),
)


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
        *_OF_ESTIMATOR,
        Signal(_OF_ITERATIONS, UNCONVERGED),
        Signal(Field(ENERGY_USED, (), "J", "energy used since the start"), ""),
    )
}
# Names of those that a filter alone has.
OF_A_FILTER = tuple(signal.field.name for signal in _OF_ESTIMATOR)
# Names of all samples that a run may save, in their order, and of those that a file may hold.
SAVED = (*FIELDS, *SIGNALS)
IN_FILES = (*SAVED, "quaternion_wxyz", "energy")


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Names of samples in the order in which they are saved."""
    wanted = set(names)
    return tuple(name for name in SAVED if name in wanted)


def saved_fields(controller: Controller | None, accounted: bool = False) -> dict[str, Field]:
    """The fields that runs of a scene with this controller, wired, may save; accounted: it accounts the energy used."""
    fields = {name: TABLE[name] for name in FIELDS}
    if accounted:
        fields[ENERGY_USED] = SIGNALS[ENERGY_USED].field
    if controller is None or controller.bus is None:
        return fields
    absent = _absent_groups(controller)
    signals = {
        name: signal.field for name, signal in SIGNALS.items() if name != ENERGY_USED and signal.group not in absent
    }
    channels = sum(count for _, count in controller.bus.commands.values())
    return fields | signals | {name: replace(signals[name], shape=(channels,)) for name in CHANNELS}


# Groups of signals that only some controllers have: what a scene lacks that has not, and the remedy.
_SOME = {
    ESTIMATE: (
        "is told by a filter, which this scene has not, or which does not report",
        'give [[controller.sensors]] type = "error_state_filter" with report = true',
    ),
    UNCONVERGED: ("is told by parts that iterate, which this controller has not", "leave it out"),
}


def _absent_groups(controller: Controller) -> set[str]:
    """The groups of signals that a wired controller has not."""
    rows = {ESTIMATE: controller.bus.belief, UNCONVERGED: controller.bus.unconverged}
    return {group for group, row in rows.items() if row < 0}


def has_shape(name: str, shape: tuple[int, ...]) -> bool:
    """Whether numbers of one vehicle at one time may have this shape, in some scene."""
    if name in CHANNELS:
        return len(shape) == 1 and shape[0] > 0
    return shape == (TABLE[name] if name in TABLE else SIGNALS[name].field).shape


def row_of(name: str, bus: Bus, noted: Mapping[str, int]) -> int:
    """The first row of the memory that holds a signal."""
    signal = SIGNALS[name]
    if signal.group == ESTIMATE:
        return bus.belief + signal.row
    firsts = {"command": 0, "unmet": bus.unmet, "actuator": bus.report, UNCONVERGED: bus.unconverged}
    return firsts[name] if name in firsts else noted[signal.group] + signal.row


def check_names(faults: Faults, key: str, names: Any) -> tuple[str, ...]:
    """Read a list of names of samples, and add a fault for each that no sample has."""
    read = items_of(names)
    if read is None:
        faults.add(key, names, "is no list of names", 'give one, such as ["position", "attitude"]')
    for name in read or ():
        faults.choice(key, name, SAVED)
    return tuple(read or ())


def check_signals(faults: Faults, key: str, names: Iterable[str], scene: Any) -> None:
    """Add a fault for each signal that a scene does not have."""
    accounted = any(term.accounts for term in scene.terms)
    for name in (name for name in ordered(names) if name in SIGNALS):
        if name == ENERGY_USED:
            if not accounted:
                remedy = 'give a term of type "energy_use", or leave it out'
                faults.add(key, name, "is not accounted in this scene", remedy)
        elif scene.controller is None:
            problem = "is a signal of a controller, which this scene has not"
            faults.add(key, name, problem, "give [controller], or leave it out")
    controller = scene.controller
    wired = controller is not None and controller.bus is not None
    absent = _absent_groups(controller) if wired else set(_SOME)
    for name in ordered(names) if controller is not None else ():
        if name in SIGNALS and SIGNALS[name].group in absent:
            faults.add(key, name, *_SOME[SIGNALS[name].group])
