# SPDX-License-Identifier: Apache-2.0
"""The base classes of a controller's parts: numbers as those of terms, and where each part finds what others write."""

from __future__ import annotations

import copy
import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults, among
from lgvi_warp.control.gain_tables import GainTable, as_given, sounder_of, taken_tables
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, word_of

if TYPE_CHECKING:
    from lgvi_warp.common.places import LocalPlane

# What guidance may give, and laws may need.
WISHES = ("depth", "position", "velocity", "heading", "attitude", "angular_velocity", "speed")
# Those that say it all; the others say the same in other words.
PLAIN_WISHES = ("depth", "position", "heading", "speed")
# For each wish those by any of which a law brings it about.
READ_BY = {
    "depth": {"depth", "position"},
    "position": {"position", "velocity", "heading"},
    "heading": {"heading", "attitude"},
    "speed": {"speed", "velocity", "position"},
    "velocity": {"velocity", "position", "speed"},
    "attitude": {"attitude", "heading"},
    "angular_velocity": {"angular_velocity", "attitude", "heading"},
}


# What sensors read, and how many numbers each has.
READINGS = {
    "depth": 1,
    "heading": 1,
    "position": 3,
    "attitude": 3,
    "velocity": 3,
    "water_velocity": 3,
    "angular_velocity": 3,
}


class Bus(NamedTuple):
    """The first rows of the memory, by which parts hand numbers on: {actuator: (first row, channels)} and single rows.

    handed: First rows of what sensors hand to an estimator, by their keys; belief: first row of what the estimator believes.
    acting: First row of the commands that act, where commands are delayed. As many rows of the commands before follow, and the
        row of the step from which the former act. period: Time between two ticks [s]. ranges: Row of each altimeter's reading.
    rejected: First of the rows with the counts of readings that an estimator's gate rejects; -1 where none has a gate.
    diverged: Row of the number of ticks at which an estimator's error was far beyond what it believes, the last but one of
        those of what it believes; the row behind it as that of `unconverged`. -1 where no estimator reports.
    unconverged: Row of the number of solutions by iterations that had not converged at their tick; the row behind it holds the
        time of the first one, a period later [s]. -1 where no part iterates.
    done: First of two rows of each part at which an event looks, by its key. Of guidance: 1 once it is done, and since when
        [s]; of an estimator: the standard deviation of its position [m], and the time of that tick [s].
    """

    commands: Mapping[str, tuple[int, int]]
    unmet: int
    report: int
    acting: int
    rows: int
    delayed: bool = False
    period: float = 1.0
    answer: int = 0
    ranges: Mapping[str, int] = MappingProxyType({})
    handed: Mapping[str, int] = MappingProxyType({})
    belief: int = -1
    rejected: int = -1
    diverged: int = -1
    unconverged: int = -1
    done: Mapping[str, int] = MappingProxyType({})

    @property
    def channels(self) -> int:
        """Number of commands of all actuators together."""
        return self.unmet

    @classmethod
    def of(
        cls,
        channels: Mapping[str, int],
        period: float = 1.0,
        answers: int = 0,
        altimeters: Sequence[str] = (),
        handed: Mapping[str, int] = MappingProxyType({}),
        belief: int = 0,
        rejected: int = 0,
        iterates: bool = False,
        ending: Sequence[str] = (),
    ) -> Bus:
        """The bus of some actuators, with a time between two ticks [s].

        channels: Commands of each. answers: Rows for answers of the host. altimeters: Their keys. handed: Rows that sensors
            hand to an estimator, by their keys; belief: rows of what it believes, of which `rejected` are counts of what its
            gate rejects. iterates: Whether a part does. ending: Keys of the parts at which an event looks.
        """
        commands, row = {}, 0
        for key, count in channels.items():
            commands[key] = (row, count)
            row += count
        ranges = {key: 4 * row + 7 + i for i, key in enumerate(altimeters)}
        rows = 4 * row + 7 + len(ranges)
        handing, end = {}, rows + answers
        for key, count in handed.items():
            handing[key] = end
            end += count
        places: dict[str, Any] = {
            "answer": rows, "ranges": ranges, "handed": handing, "belief": end if belief else -1,
            "rejected": end + belief - 2 - rejected if rejected else -1, "diverged": end + belief - 2 if belief else -1,
            "unconverged": end + belief if iterates else -1,
        }  # fmt: skip
        end += belief + 2 * iterates
        places["done"] = {key: end + 2 * i for i, key in enumerate(ending)}
        return cls(commands, row, row + 6, 2 * row + 6, end + 2 * len(ending), period=period, **places)

    def values_of(self, key: str) -> dict[str, Any]:
        """Numbers that the device code of an actuator reads."""
        first = self.commands[key][0]
        if not self.delayed:
            return {"commands": {"row": first}, "report": self.report + first}
        rows = {"row": self.acting + first, "old": self.acting + self.channels + first}
        begin = self.acting + 2 * self.channels
        return {"commands": rows | {"begin": begin}, "report": self.report + first}


@dataclass(frozen=True, eq=False, kw_only=True)
class Part(Term):
    """A part of a controller: a term in all but the list that it stands in.

    Args:
        name: Name of the part in parameters ("name.field"); by default its type.

    Attributes:
        section: List of the controller in which it stands.
        device: As in `Term`; the module is one of lgvi_kernels.laws.control.
        needs: What it reads of the wanted motion, among `WISHES`.
        gives: What it wants of the motion, among `WISHES`.
        bus: Where it finds the numbers of other parts.
    """

    acts: ClassVar[bool] = False
    section: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    # What its device code may have, in this order, and what that of a run has.
    every_feature: ClassVar[tuple[str, ...]] = ()
    chosen: ClassVar[tuple[str, ...]] = ()
    # Whether it solves a problem by iterations, and counts the ticks at which these have not converged.
    iterates: ClassVar[bool] = False
    # Where it finds the numbers of others; set for a part of a scene.
    bus: ClassVar[Bus]
    # Words that may stand in place of a number, by its name.
    words_for: ClassVar[Mapping[str, str]] = {}

    @property
    def gives(self) -> tuple[str, ...]:
        """Quantities that it wants of the motion, among `WISHES`; by default nothing."""
        return ()

    @property
    def ends(self) -> str:
        """Type of the event that may look at it, in the rows `bus.done`; by default "", none."""
        return ""

    @property
    def ticks_before(self) -> int:
        """Number of ticks that it must have had before a time at which a member starts anew beside others; by default 0."""
        return 0

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        """Say what its device code must have for these numbers.

        Args:
            numbers: Numbers of its fields by name, of all members, each (n, ...).

        Returns:
            Words among `every_feature`; by default none.
        """
        return ()

    def with_features(self, known: frozenset[str]) -> Any:
        """Choose the device code for what some member of a run needs.

        Args:
            known: Words "key.feature" of all parts.

        Returns:
            A copy.
        """
        part = copy.copy(self)
        chosen = tuple(word for word in self.every_feature if f"{self.key}.{word}" in known)
        object.__setattr__(part, "chosen", chosen)
        return part

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        """Tell the part what it needs to know of the scene's events and of the sensors.

        Args:
            faults: Collects the faults of what is missing.
            events: Events of the scene.
            sensors: Sensors of the controller, each of which knows the scene.

        Returns:
            A copy, or the part where it needs nothing; by default the latter.
        """
        return self

    def located(self, plane: LocalPlane | None) -> Any:
        """Convert the places on the Earth that the part has, if it has any, to positions.

        Args:
            plane: The plane of the scene's inertial axes on the Earth; None where the scene has no origin.

        Returns:
            By default the part itself.

        Raises:
            SceneError: If the part has places, and the scene no origin.
        """
        return self

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        """Tell the part where it finds what others write.

        Args:
            bus: Rows of the controller's memory.
            others: Terms that take commands, and sensors, by key.

        Returns:
            A copy.
        """
        part = copy.copy(self)
        object.__setattr__(part, "bus", bus)
        return part

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers as they are: a controller works in the user's axes.
        if self.lanes() is None:
            name = type(self).__name__
            raise NotImplementedError(
                f"{name} must define packed(numbers, context): see docs/develop/add_a_controller.md"
            )
        values = {item.name: numbers[word_of(item)] for item in self.number_fields() if word_of(item) in numbers}
        return Packed(values | self.words(), memory=self.first_memory)

    def words(self) -> dict[str, Any]:
        """Return the fields of the device struct beside the numbers; by default there are none."""
        return {}


AnyPart = TypeVar("AnyPart", bound=Part)


def _built_in(section: str, *words: str) -> registry.Kinds:
    """The parts of these types in a list of a controller, each in the file of its name."""
    return registry.Kinds("lgvi_warp.control", {word: [word] for word in words}, section)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuringPart(Part):
    """A sensor or an estimator: changes the measured motion that the controller uses.

    Attributes:
        uses: Keys of the sensors that hand their readings to this estimator alone, by what they are to it.
        linear: Whether linear models of a loop may have it.
    """

    section: ClassVar[str] = "sensors"
    kinds: ClassVar[registry.Kinds] = _built_in(
        "sensors",
        "altimeter",
        "complementary_filter",
        "sensor",
        "dead_reckoning",
        "low_pass",
    )
    # Whether linear models of a loop may have it.
    linear: ClassVar[bool] = True
    # Rows of the bus with what it believes, beside the measurement; of these, counts of readings that its gate rejects.
    belief_rows: ClassVar[int] = 0
    rejected_rows: ClassVar[int] = 0
    # For faults: what it reads, among READINGS; of the rows that it hands on those behind its numbers that tell what is new,
    # and whether its numbers are sums over a period.
    reading: ClassVar[str] = ""
    handed_flags: ClassVar[int] = 0
    sums: ClassVar[bool] = False

    @property
    def estimates_position(self) -> bool:
        """Whether it changes the measured position, whose difference from the true one is then the navigation error."""
        return False

    @property
    def uses(self) -> Mapping[str, str]:
        """Keys of the sensors that hand their readings to this estimator alone, by what they are to it; by default none."""
        return {}

    @property
    def handed_rows(self) -> int:
        """Numbers that it hands to an estimator at a tick; 0, the default, for a part that can hand on nothing."""
        return 0

    def fault_channels(self, handed: bool) -> int:
        """Count of numbers that faults can change; by default that of `reading`, 0 where it reads nothing.

        Args:
            handed: Whether an estimator takes its readings.
        """
        return READINGS.get(self.reading, 0)

    @property
    def is_handed(self) -> bool:
        """Whether an estimator of the scene takes its readings: then it leaves the measurement as it is."""
        return hasattr(self, "bus") and self.key in self.bus.handed

    def check_used(self, faults: Faults, sensors: Sequence[Any]) -> None:
        """Add a fault for each sensor that this estimator cannot use.

        Args:
            faults: Collects the faults.
            sensors: All parts of the list, in their order.
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class Guidance(Part):
    """Guidance: sets the wanted motion.

    Attributes:
        wanted: The quantities of `gives` for which the user asked.
    """

    section: ClassVar[str] = "guidance"
    kinds: ClassVar[registry.Kinds] = _built_in(
        "guidance", "altitude", "docking", "loiter", "reference_model", "set_point", "trajectory", "waypoints"
    )

    # Whether what it wants follows from the time alone, so that laws may look ahead.
    foreseeable: ClassVar[bool] = False

    @property
    def wanted(self) -> tuple[str, ...]:
        """The quantities of `gives` for which the user asked, so that some law should read them; by default all of them."""
        return self.gives


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlLaw(Part):
    """A law: the demand X, Y, Z [N] and K, M, N [N m] in the body's axes, from what is wanted and what is measured.

    Attributes:
        demands: Components that it asks for, among `COMPONENTS`; none named: all of them.
    """

    section: ClassVar[str] = "laws"
    kinds: ClassVar[registry.Kinds] = _built_in(
        "laws",
        "callback",
        "depth_pid",
        "heading_pid",
        "heading_smc",
        "heave_pid",
        "policy",
        "pose_pid",
        "pose_smc",
        "speed_pid",
        "state_feedback",
    )
    demands: ClassVar[tuple[str, ...]] = ()
    # Rows of the memory, from `Bus.answer` on, by which laws hand numbers on within a tick.
    shared_rows: ClassVar[int] = 0
    # Numbers of the vehicle by name, as the scene has them, whatever a member's are; set for a law of a scene.
    nominal: ClassVar[Numbers] = {}
    # The nodes of numbers that are tables over what is measured, and the altimeter that these read; set for an object.
    gain_tables: ClassVar[Mapping[str, GainTable]] = {}
    sounder: ClassVar[Any] = None

    @property
    def foresees(self) -> bool:
        """Whether it looks ahead at what guidance will want; by default False."""
        return False

    def __post_init__(self) -> None:
        # Numbers may be tables: see gain_tables.py.
        object.__setattr__(self, "gain_tables", taken_tables(self))
        super().__post_init__()

    @classmethod
    def device_fields(cls, name: str) -> tuple[str, ...]:
        """Fields of the device struct that a number becomes, for tables of it over what is measured.

        Args:
            name: Name of the number.

        Returns:
            Names of fields; none, if the number can be no table. By default the number itself where the class does not define
            `packed`.
        """
        own = cls.packed is Part.packed and cls.lanes() is not None
        return tuple(item.name for item in cls.number_fields() if own and word_of(item) == name)

    def shape_of(self, item: Any) -> tuple[Any, ...]:
        # Of a table with its nodes first.
        shape = super().shape_of(item)
        table = self.gain_tables.get(word_of(item))
        return shape if table is None else (len(table.at), *shape)

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        # A table stays one where its values are given anew; what has another shape takes its place.
        numbers, tables = self.parameters(), as_given(self)
        kept = {}
        for item in self.number_fields():
            name = word_of(item)
            given: Any = fields.get(item.name)
            if name in tables and (item.name not in fields or np.shape(given) == numbers[name].shape):
                kept[item.name] = tables[name] | ({} if given is None else {"values": given})
        return super().with_fields({**fields, **kept})

    def table_without(self, names: Collection[str]) -> dict[str, Any]:
        tables = {name: table for name, table in as_given(self).items() if name not in names}
        return super().table_without(names) | tables

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        sounder = sounder_of(self, faults, sensors)
        if sounder is None:
            return self
        law = copy.copy(self)
        object.__setattr__(law, "sounder", sounder)
        return law

    def of_vehicle(self, nominal: Numbers) -> Any:
        """The same law, knowing the vehicle that its author had in mind.

        Args:
            nominal: Parameters of vehicle and environment by name, each of the shape that the scene has.

        Returns:
            A copy.
        """
        law = copy.copy(self)
        object.__setattr__(law, "nominal", nominal)
        return law


def list_of_names(faults: Faults, key: str, names: Any, known: Collection[str]) -> list[str]:
    """Names of a list that are known and occur once; what is wrong with others is noted."""
    listed = items_of(names)
    if not listed:
        faults.add(key, names, "is not a list of names", f"give some of {', '.join(known)}")
        return []
    for i, name in enumerate(listed):
        if faults.choice(f"{key}[{i}]", name, known) and among(name, listed[:i]):
            faults.add(f"{key}[{i}]", name, "is named twice", "leave one of them out")
    return [name for name in listed if among(name, known)]


# How a law's integral is kept from growing while actuators are at their limits.
ANTI_WINDUP = ("conditional", "none")


@dataclass(frozen=True, eq=False, kw_only=True)
class IntegralLaw(ControlLaw):
    """A law with integrals, each in two rows of the memory.

    Args:
        anti_windup: "conditional", the default: an integral stays as it is while the actuators do not deliver the demand and
            its error would make this worse; or "none".
    """

    # Rows of the memory, two of each integral's number; and what the device code calls several limits of integrals.
    memory_rows: ClassVar[int] = 2
    limits: ClassVar[tuple[str, ...]] = ()

    anti_windup: str = word("conditional", known=ANTI_WINDUP)

    @classmethod
    def device_fields(cls, name: str) -> tuple[str, ...]:
        # As `packed` names them.
        if name == "integral_limit":
            return cls.limits or (name,)
        return ("rate",) if name == "lambda" else (name,)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The numbers, each limit by itself, the memory of the integrals, and where the law finds what was not delivered.
        values = {"rate" if name == "lambda" else name: value for name, value in numbers.items()}
        if self.limits:
            values |= zip(self.limits, values.pop("integral_limit").T, strict=True)
        words = {"unmet": self.bus.unmet, "conditional": int(self.anti_windup == "conditional")}
        return Packed(values | words, memory=self.first_memory)


# What a law of the pose adds to its demand.
FEEDFORWARD = ("none", "restoring")


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseLaw(IntegralLaw):
    """A law of position and attitude, each with an integral of three numbers.

    Args:
        feedforward: "restoring": what balances weight, buoyancy and their moment at the measured attitude, by the numbers of
            the scene, whatever a member's are: a controller does not know them; or "none", the default.
    """

    needs: ClassVar[tuple[str, ...]] = ("position", "velocity", "attitude", "angular_velocity")
    demands: ClassVar[tuple[str, ...]] = ("X", "Y", "Z", "K", "M", "N")
    memory_rows: ClassVar[int] = 12
    limits: ClassVar[tuple[str, ...]] = ("position_limit", "attitude_limit")

    feedforward: str = word("none", known=FEEDFORWARD)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # In addition, the nominal weight less buoyancy with the moment of both.
        net, moment = np.zeros(1), np.zeros((1, 3))
        if self.feedforward == "restoring":
            net, moment = restoring(self.nominal)
        return super().packed({**numbers, "net_weight": net, "moment": moment}, context)


def restoring(nominal: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Weight less buoyancy (1,) [N], downward, and the sum of both times their points (1, 3) [N m], body axes, of a scene.

    The cross product of the latter with the direction downward is the moment.
    """
    numbers = {name: np.asarray(value)[None] for name, value in nominal.items()}
    weight, buoyancy = vehicle.weight(numbers), numbers["vehicle.buoyancy"]
    centers = vehicle.center_of_mass(numbers), numbers["vehicle.center_of_buoyancy"]
    return weight - buoyancy, weight[:, None] * centers[0] - buoyancy[:, None] * centers[1]


# A step beyond any run, within float32. A time and a number of steps that differ by less than the second, as a part of
# the step, are the same.
NEVER, SAME_TIME = 1e30, 1e-6


def first_step(time: np.ndarray, h: float) -> np.ndarray:
    """The first step at or after times [s] of any shape; `NEVER` for never."""
    return np.ceil(np.minimum(time / h, NEVER) - SAME_TIME)


@dataclass(frozen=True, eq=False, kw_only=True)
class Allocation(Part):
    """Allocation: turns the demand into the commands of one term.

    Args:
        to: Key of the term that takes the commands.

    Attributes:
        actuator: The term that takes the commands.

    Methods:
        reach: The wrench of a unit of each command.
    """

    section: ClassVar[str] = "allocation"
    kinds: ClassVar[registry.Kinds] = _built_in("allocation", "pseudo_inverse", "bounded_least_squares", "matrix")
    # The term that takes the commands, the faults of its channels that are known, and which of X Y Z K M N laws ask for (6,);
    # set for a part of a scene.
    actuator: ClassVar[Any] = None
    losses: ClassVar[tuple[Any, ...]] = ()
    asked: ClassVar[np.ndarray] = np.ones(6)

    to: str = ""

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        # The same part, knowing its actuator as well.
        part = super().wired(bus, others)
        object.__setattr__(part, "actuator", others[self.to])
        return part

    def informed(self, faults: Sequence[Any], components: np.ndarray) -> Any:
        """The same part, knowing which channels are lost from some time on, and which components count.

        Args:
            faults: Faults of actuators.
            components: 1 for each of X Y Z K M N that laws ask for, else 0, (6,).

        Returns:
            A copy.
        """
        part = copy.copy(self)
        known = tuple(fault for fault in faults if fault.of == self.to and fault.known)
        object.__setattr__(part, "losses", known)
        object.__setattr__(part, "asked", components)
        return part

    @property
    def lost_channels(self) -> tuple[int, ...]:
        """Numbers of the channels that are known to be lost at some time."""
        return tuple(sorted({fault.channel for fault in self.losses}))

    def steps_of_loss(self, context: PackingContext) -> np.ndarray:
        """The first step at which each channel is known to be lost.

        Args:
            context: The scene's parameters and the step.

        Returns:
            Numbers of steps (1 or n, channels); `NEVER` for a channel that is not.
        """
        times = [np.full((1, self.actuator.channels), NEVER)]
        for fault in self.losses:
            time = context.parameters[f"{fault.key}.time"]
            lost_from = np.full((len(time), self.actuator.channels), NEVER)
            lost_from[:, fault.channel] = first_step(time, context.h)
            times.append(lost_from)
        return np.asarray(functools.reduce(np.minimum, times))

    def check_actuator(self, faults: Faults) -> None:
        """Add a fault for what does not fit the actuator.

        Args:
            faults: Collects the faults.
        """

    def reach(self) -> np.ndarray:
        """Wrench of each channel, of the scene's own numbers.

        Returns:
            (6, channels) [N, N m], of any size. By default, for a part that does not know it, every component by itself.
        """
        return np.eye(6)


# Entries of a projector below this are round-off.
ROUND_OFF = 1e-12


def rest_rows(reached: np.ndarray) -> np.ndarray:
    """The projector onto the demands beside those reached (n, 6, 6), line by line (n, 36), without round-off."""
    others = np.eye(6) - reached
    return np.where(np.abs(others) < ROUND_OFF, 0.0, others).reshape(len(others), -1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sending(Part):
    """A part that changes commands on their way to the actuators."""

    section: ClassVar[str] = "faults"
    kinds: ClassVar[registry.Kinds] = _built_in("faults", "fault")


# The bases of parts by the list that they stand in, in the order in which their roles act.
SECTIONS: dict[str, type[Part]] = {
    kind.section: kind for kind in (MeasuringPart, Guidance, ControlLaw, Allocation, Sending)
}
