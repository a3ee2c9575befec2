# SPDX-License-Identifier: Apache-2.0
"""Quantities that a run may save in addition to the motion: signals of a controller and the energy used.

A table gives the shape, unit and meaning of each by its name.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from lgvi_warp.common import registry
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.fields import FIELDS, TABLE, Field

if TYPE_CHECKING:
    from lgvi_warp.control.base import Bus
    from lgvi_warp.control.controller import Controller


class Signal(NamedTuple):
    """A signal and its rows in the kernel. The field's shape is (1,) if the size follows from the scene's commands."""

    field: Field
    group: str
    row: int = 0


# The one that needs no controller, but a term that keeps the account.
ENERGY_USED = "energy_used"
# The measured position less the true one: the kernel writes the former, and the host takes the latter off.
NAVIGATION_ERROR = "navigation_error"
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


# The groups of signals that lie in the rows of what an estimator believes, and of what its gate rejects: it adds its own.
ESTIMATE, REJECTED = "estimate", "rejected"


def _noted(group: str, word: str, kinds: Mapping[str, Field], rows: Mapping[str, int]) -> tuple[Signal, ...]:
    def field(kind: str) -> Field:
        return replace(kinds[kind], name=f"{group}_{kind}", meaning=f"{word} {kinds[kind].meaning}")

    return tuple(Signal(field(kind), group, row) for kind, row in rows.items())


class SignalTable(registry.Kinds):
    """Signals by name. A part of an extension adds its own signals by `add_signals` when its module is imported."""

    def _import(self, word: object) -> None:
        # No extension is asked for what is no signal.
        if word not in TABLE:
            super()._import(word)


SIGNALS = SignalTable("", {}, "signals")
# Groups of signals that only some controllers have, and single ones: what a scene lacks that has not, and the remedy.
_SOME: dict[str, tuple[str, str]] = {
    NAVIGATION_ERROR: (
        "needs an estimate of the position, which nothing in this scene makes",
        'give [[controller.sensors]] of = "position", or type = "dead_reckoning" behind the sensors that it uses',
    )
}


def add_signals(*signals: Signal, absent: tuple[str, str] | None = None) -> None:
    """Add signals to the table.

    absent: Problem and remedy to report for a controller without these signals, if only some controllers have them.
    """
    for signal in signals:
        SIGNALS[signal.field.name] = signal
        if absent:
            _SOME[signal.group] = absent


add_signals(
    *_OF_ACTUATORS,
    *_noted("measured", "measured", _KINDS, _MEASURED),
    *_noted("reference", "wanted", _REFERENCE, _WANTED),
)
add_signals(
    Signal(_OF_ITERATIONS, UNCONVERGED),
    absent=("is reported by parts that iterate, and this controller has none", "leave it out"),
)
add_signals(
    Signal(Field(ENERGY_USED, (), "J", "energy used since the start"), ""),
    Signal(
        Field(NAVIGATION_ERROR, (3,), "m", "measured or estimated position less the true one, inertial axes"),
        "measured",
    ),
)


class Names(Collection[str]):
    """Names of samples: those of the motion, of all signals, and others. Extensions are searched for an unknown name."""

    def __init__(self, *others: str):
        self._others = others

    def __contains__(self, name: object) -> bool:
        return name in FIELDS or name in self._others or name in SIGNALS

    def __iter__(self) -> Iterator[str]:
        return iter((*FIELDS, *SIGNALS, *self._others))

    def __len__(self) -> int:
        return sum(1 for _ in self)


# All samples that a run may save, and those that a file may hold.
SAVED, IN_FILES = Names(), Names("quaternion_wxyz", "energy")


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Names of samples in the order in which they are saved."""
    wanted = {name for name in names if name in SAVED}
    return tuple(name for name in (*FIELDS, *SIGNALS.loaded) if name in wanted)


def saved_fields(controller: Controller | None, accounted: bool = False) -> dict[str, Field]:
    """Fields that runs with this wired controller may save; `accounted`: whether the scene accounts the energy used."""
    fields = {name: TABLE[name] for name in FIELDS}
    if accounted:
        fields[ENERGY_USED] = SIGNALS[ENERGY_USED].field
    if controller is None or controller.bus is None:
        return fields
    absent = _absent(controller)
    signals = {
        name: signal.field
        for name, signal in SIGNALS.loaded.items()
        if name != ENERGY_USED and not {name, signal.group} & absent
    }
    channels = sum(count for _, count in controller.bus.commands.values())
    return fields | signals | {name: replace(signals[name], shape=(channels,)) for name in CHANNELS}


def _absent(controller: Controller) -> set[str]:
    """The groups of signals, and the single signals, that a wired controller lacks."""
    rows = {ESTIMATE: controller.bus.belief, REJECTED: controller.bus.rejected, UNCONVERGED: controller.bus.unconverged}
    rows[NAVIGATION_ERROR] = max((int(part.estimates_position) for part in controller.sensors), default=0) - 1
    return {group for group, row in rows.items() if row < 0}


def field_of(name: str) -> Field:
    """The field of a sample by its name."""
    return TABLE[name] if name in TABLE else SIGNALS[name].field


def has_shape(name: str, shape: tuple[int, ...]) -> bool:
    """Whether a field of one vehicle at one time can have this shape in some scene."""
    if name in CHANNELS:
        return len(shape) == 1 and shape[0] > 0
    return shape == field_of(name).shape


def row_of(name: str, bus: Bus, noted: Mapping[str, int]) -> int:
    """The first row of the memory that holds a signal."""
    signal = SIGNALS[name]
    if signal.group == ESTIMATE:
        return bus.belief + signal.row
    firsts = {
        "command": 0,
        "rejected": bus.rejected,
        "unmet": bus.unmet,
        "actuator": bus.report,
        UNCONVERGED: bus.unconverged,
    }
    return firsts[name] if name in firsts else noted[signal.group] + signal.row


def check_names(faults: Faults, key: str, names: Any) -> tuple[str, ...]:
    """Read a list of names of samples, and add a fault for each unknown name."""
    read = items_of(names)
    if read is None:
        faults.add(key, names, "is not a list of names", 'give one, such as ["position", "attitude"]')
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
            faults.add(key, name, *_SOME.get(name, (problem, "give [controller], or leave it out")))
    controller = scene.controller
    wired = controller is not None and controller.bus is not None
    absent = _absent(controller) if wired else set(_SOME)
    for name in ordered(names) if controller is not None else ():
        for group in {name, SIGNALS[name].group} & absent if name in SIGNALS else ():
            faults.add(key, name, *_SOME[group])
