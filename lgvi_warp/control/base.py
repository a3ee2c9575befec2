# SPDX-License-Identifier: Apache-2.0
"""Base classes of a controller's parts, whose numbers are declared as in terms, and the rows of memory that parts share."""

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
    """Rows of the memory through which parts exchange numbers; `commands` is {actuator: (first row, channels)}.

    handed: First row of the readings that each sensor passes to an estimator, by key. belief: First row of the estimator.
    acting: First row of the commands in effect, if commands are delayed. As many rows of the previous commands follow, then
        the row of the step at which the new ones take effect. period: Time between two ticks [s]. ranges: Row of each
        altimeter's reading. rejected: First row of the counts of readings that an estimator's gate rejects; -1 without a gate.
    diverged: Row of the number of ticks at which an estimator's error was far larger than its own covariance predicts. It is
        the last row but one of the estimator; the next row is as for `unconverged`. -1 if no estimator reports this.
    unconverged: Row of the number of iterative solutions that had not converged at their tick. The next row holds the time
        of the first of them plus one period [s]. -1 if no part iterates.
    done: First of two rows of each part that an event watches, by key. For guidance: 1 once it is done, and the time since
        then [s]; for an estimator: the standard deviation of its position [m], and the time of that tick [s].
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
        """Total number of commands of all actuators."""
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
        """The bus of some actuators.

        channels: Number of commands of each actuator, by key. period: Time between two ticks [s]. answers: Number of rows for
            answers of the host. altimeters: Keys of altimeters. handed: Number of rows that each sensor passes to an
            estimator, by key. belief: Number of rows of the estimator, of which `rejected` are counts of rejected readings.
            iterates: Whether some part iterates. ending: Keys of the parts that an event watches.
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
    """Base class of a controller's parts. A part is defined like a term, but it is listed in the controller.

    Args:
        name: Name of the part in parameters ("name.field"); by default its type.

    Attributes:
        section: List of the controller in which the part is given, such as "laws".
        device: As in `Term`; the module is one of lgvi_kernels.laws.control.
        needs: Quantities of the wanted motion that the part reads, among `WISHES`.
        gives: Quantities of the wanted motion that the part sets, among `WISHES`.
        bus: Rows of the memory in which the part finds the numbers of other parts.
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
        """Quantities of the wanted motion that the part sets, among `WISHES`; by default none."""
        return ()

    @property
    def ends(self) -> str:
        """Type of the event that may watch this part, in the rows `bus.done`; by default "", for none."""
        return ""

    @property
    def ticks_before(self) -> int:
        """Number of ticks that the part needs before a time at which copies of a member are started; by default 0."""
        return 0

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        """Features of the device code that these numbers require.

        Args:
            numbers: Numbers of the part's fields by name, of all members, each (n, ...).

        Returns:
            Words among `every_feature`; by default none.
        """
        return ()

    def with_features(self, known: frozenset[str]) -> Any:
        """Select the features of the device code that some member of a run requires.

        Args:
            known: Required features of all parts, as "key.feature".

        Returns:
            A copy of the part with these features.
        """
        part = copy.copy(self)
        chosen = tuple(word for word in self.every_feature if f"{self.key}.{word}" in known)
        object.__setattr__(part, "chosen", chosen)
        return part

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        """Give the part the events and sensors that it uses.

        Args:
            faults: Collects a fault for each thing that is missing.
            events: Events of the scene.
            sensors: Sensors of the controller, which already know the scene.

        Returns:
            A copy that knows them, or the part itself if it uses none, which is the default.
        """
        return self

    def located(self, plane: LocalPlane | None) -> Any:
        """Convert the part's geodetic points, if it has any, to positions in inertial axes.

        Args:
            plane: The plane of the scene's inertial axes on the Earth; None if the scene has no origin.

        Returns:
            A copy with positions; by default the part itself.

        Raises:
            SceneError: If the part has geodetic points and the scene has no origin.
        """
        return self

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        """Give the part the rows of memory that other parts write.

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
        """Return the fields of the device struct other than the part's numbers; by default there are none."""
        return {}


AnyPart = TypeVar("AnyPart", bound=Part)


def _built_in(section: str, *words: str) -> registry.Kinds:
    """The types of parts that a list of a controller may hold; each type has a file of its name."""
    return registry.Kinds("lgvi_warp.control", {word: [word] for word in words}, section)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuringPart(Part):
    """Base class of sensors and estimators, which change the measured motion that the controller uses.

    Attributes:
        uses: {role: key} of the sensors that pass their readings to this estimator only.
        linear: Whether linear models of a control loop may contain this part.
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
        """Whether the part changes the measured position. If so, measured minus true position is the navigation error."""
        return False

    @property
    def uses(self) -> Mapping[str, str]:
        """{role: key} of the sensors that pass their readings to this estimator only; by default none."""
        return {}

    @property
    def handed_rows(self) -> int:
        """Count of numbers that the part passes to an estimator at a tick; 0, the default, if it can pass none."""
        return 0

    def fault_channels(self, handed: bool) -> int:
        """Count of numbers that faults can change; by default all numbers of the reading, or 0 for a part without a reading.

        Args:
            handed: Whether an estimator takes the part's readings.
        """
        return READINGS.get(self.reading, 0)

    @property
    def is_handed(self) -> bool:
        """Whether an estimator takes this part's readings. If so, the part does not change the measured motion itself."""
        return hasattr(self, "bus") and self.key in self.bus.handed

    def check_used(self, faults: Faults, sensors: Sequence[Any]) -> None:
        """Add a fault for each sensor that this estimator cannot use.

        Args:
            faults: Collects the faults.
            sensors: All sensors and estimators of the controller, in their order.
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class Guidance(Part):
    """Base class of guidance, which sets the wanted motion.

    Attributes:
        wanted: The quantities of `gives` that the user requested.
    """

    section: ClassVar[str] = "guidance"
    kinds: ClassVar[registry.Kinds] = _built_in(
        "guidance", "altitude", "docking", "loiter", "reference_model", "set_point", "trajectory", "waypoints"
    )

    # Whether what it wants follows from the time alone, so that laws may look ahead.
    foreseeable: ClassVar[bool] = False

    @property
    def wanted(self) -> tuple[str, ...]:
        """The quantities of `gives` that the user requested, which laws should read; by default all of `gives`."""
        return self.gives


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlLaw(Part):
    """Base class of control laws, which compute the demand from the wanted and the measured motion.

    The demand is the force X, Y, Z [N] and the moment K, M, N [N m] in body axes.

    Attributes:
        demands: Components that the law demands, among `COMPONENTS`; an empty tuple stands for all of them.
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
        """Whether the law uses future values of the wanted motion; by default False."""
        return False

    def __post_init__(self) -> None:
        # Numbers may be tables: see gain_tables.py.
        object.__setattr__(self, "gain_tables", taken_tables(self))
        super().__post_init__()

    @classmethod
    def device_fields(cls, name: str) -> tuple[str, ...]:
        """Fields of the device struct that hold a number, so that the number can be a gain table.

        Args:
            name: Name of the number.

        Returns:
            Names of fields; empty if the number cannot be a table. By default the number's own name, if the class does not
            define `packed`.
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
        """The same law, with access to the numbers of the scene's nominal vehicle, which do not vary by member.

        Args:
            nominal: Parameters of vehicle and environment by name, each with its shape in the scene.

        Returns:
            A copy.
        """
        law = copy.copy(self)
        object.__setattr__(law, "nominal", nominal)
        return law


def list_of_names(faults: Faults, key: str, names: Any, known: Collection[str]) -> list[str]:
    """The known names of a list, each once. Adds a fault for every other entry."""
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
    """Base class of laws with integrals; each integral has two rows of the memory.

    Args:
        anti_windup: "conditional", the default, stops an integrator while the actuators do not deliver the whole demand
            and further integration would increase the undelivered part. "none" never stops an integrator.
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
    """Base class of laws of position and attitude, each with an integral of three numbers.

    Args:
        feedforward: "restoring" balances weight, buoyancy and their moment at the measured attitude. It uses the scene's
            nominal numbers for every member. "none", the default, adds nothing.
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
    """Weight minus buoyancy (1,) [N] of a scene, and weight times its point minus buoyancy times its point (1, 3) [N m].

    The points are in body axes. The cross product of the second result with the downward direction is the moment.
    """
    numbers = {name: np.asarray(value)[None] for name, value in nominal.items()}
    weight, buoyancy = vehicle.weight(numbers), numbers["vehicle.buoyancy"]
    centers = vehicle.center_of_mass(numbers), numbers["vehicle.center_of_buoyancy"]
    return weight - buoyancy, weight[:, None] * centers[0] - buoyancy[:, None] * centers[1]


# A step beyond any run, within float32. A time and a number of steps that differ by less than the second, as a part of
# the step, are the same.
NEVER, SAME_TIME = 1e30, 1e-6


def first_step(time: np.ndarray, h: float) -> np.ndarray:
    """Index of the first step at or after times [s] of any shape; `NEVER` for an infinite time."""
    return np.ceil(np.minimum(time / h, NEVER) - SAME_TIME)


@dataclass(frozen=True, eq=False, kw_only=True)
class Allocation(Part):
    """Base class of allocations, which turn the demand into the commands of one term.

    Args:
        to: Key of the term that takes the commands.

    Attributes:
        actuator: The term that takes the commands.

    Methods:
        reach: Wrenches (6, channels) that the channels produce; only the directions of the wrenches count.
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
        """The same part with the known losses of channels and the demanded components.

        Args:
            faults: Faults of actuators.
            components: Six numbers for X Y Z K M N: 1 if some law demands the component, otherwise 0.

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
        """Indices of the channels that have a known fault, at whatever time it begins."""
        return tuple(sorted({fault.channel for fault in self.losses}))

    def steps_of_loss(self, context: PackingContext) -> np.ndarray:
        """The first step at which the allocation knows each channel to be lost.

        Args:
            context: The scene's parameters and the step.

        Returns:
            Indices of steps (1 or n, channels); `NEVER` for a channel that is not lost.
        """
        times = [np.full((1, self.actuator.channels), NEVER)]
        for fault in self.losses:
            time = context.parameters[f"{fault.key}.time"]
            lost_from = np.full((len(time), self.actuator.channels), NEVER)
            lost_from[:, fault.channel] = first_step(time, context.h)
            times.append(lost_from)
        return np.asarray(functools.reduce(np.minimum, times))

    def check_actuator(self, faults: Faults) -> None:
        """Add a fault for each setting that does not fit the actuator.

        Args:
            faults: Collects the faults.
        """

    def reach(self) -> np.ndarray:
        """Wrench of each channel, from the scene's numbers.

        Returns:
            Wrenches (6, channels) [N, N m]; only their directions count. By default the identity (6, 6): every component
            can be produced independently.
        """
        return np.eye(6)


# Entries of a projector below this are round-off.
ROUND_OFF = 1e-12


def rest_rows(reached: np.ndarray) -> np.ndarray:
    """The projector onto undelivered demands, I minus `reached` (n, 6, 6), line by line (n, 36), with round-off set to 0."""
    others = np.eye(6) - reached
    return np.where(np.abs(others) < ROUND_OFF, 0.0, others).reshape(len(others), -1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sending(Part):
    """Base class of parts that change commands on their way to the actuators."""

    section: ClassVar[str] = "faults"
    kinds: ClassVar[registry.Kinds] = _built_in("faults", "fault")


# The bases of parts by the list that they stand in, in the order in which their roles act.
SECTIONS: dict[str, type[Part]] = {
    kind.section: kind for kind in (MeasuringPart, Guidance, ControlLaw, Allocation, Sending)
}
