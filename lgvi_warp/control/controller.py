# SPDX-License-Identifier: Apache-2.0
"""A controller: its sensors, guidance, laws, allocation and faults, its period and its delay."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import declared
from lgvi_warp.common.declared import positive, read, real
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.times import ROUND_OFF, whole_steps
from lgvi_warp.control.altimeter import Altimeter
from lgvi_warp.control.base import PLAIN_WISHES, READ_BY, SECTIONS, WISHES, Allocation, Bus, Part
from lgvi_warp.control.callback import Callback, CallbackCommands, refuse_second
from lgvi_warp.control.delay import MOST_PERIODS, Delay
from lgvi_warp.control.fault import ALL, Fault
from lgvi_warp.control.pseudo_inverse import PseudoInverse
from lgvi_warp.physics.terms import from_list
from lgvi_warp.physics.terms.base import Term, build, check_list
from lgvi_warp.physics.terms.control_wrench import COMPONENTS
from lgvi_warp.physics.terms.surface_level import below
from lgvi_warp.physics.vehicle import Vehicle

if TYPE_CHECKING:
    from lgvi_warp.common.places import LocalPlane
    from lgvi_warp.physics.terms.events import Event

# A part of a component below this is round-off, when it is asked what actuators can make.
SPANNED = 1e-8
# What a scene without actuators lacks.
ACTUATOR = 'give the vehicle a term that does, [[terms]] type = "thrusters", "control_fins" or "control_wrench"'


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller(Documented):
    """A controller that computes commands once per period, at a tick, and holds them until the next tick.

    The lists below hold parts such as lw.control.HeadingPID(...), or tables as in a scene file.

    Args:
        period: Time between two ticks [s], a whole number of steps.
        delay: Time from a tick to the effect of its commands [s], in whole steps; may vary by member. 0 by default.
        sensors: Sensors and estimators, in the order in which they act. Without sensors, the true motion is measured.
        guidance: Parts that set the wanted motion, in the order in which they act.
        laws: Parts that demand a wrench; their demands are added.
        allocation: Parts that turn the demand into commands, in this order. Each part receives the demand that the parts
            before it did not deliver. If exactly one term takes commands, the pseudo-inverse is the default.
        faults: Faults of actuators and of sensors.

    Methods:
        parameters: The numbers that may vary by member.
        to_dict: The controller as the section [controller] of a scene file.

    Raises:
        SceneError: If an argument is invalid; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> result = lw.solve(scene, h=0.05, t1=60.0)
        >>> print(f"{result.euler[-1, 0, 2]:.2f} rad")
        0.44 rad
    """

    period: float = positive(unit="s")
    delay: Any = real(0.0, unit="s", least=0.0)
    sensors: Sequence[Any] = ()
    guidance: Sequence[Any] = ()
    laws: Sequence[Any] = ()
    allocation: Sequence[Any] = ()
    faults: Sequence[Any] = ()
    # Set by `wired`.
    bus: Any = field(default=None, init=False, repr=False)
    actuators: Mapping[str, Term] = field(default_factory=dict, init=False, repr=False)

    key = "controller"

    def __post_init__(self) -> None:
        faults = Faults("controller.")
        delay = read(self, faults)["delay"]
        if delay is not None:
            object.__setattr__(self, "delay", np.asarray(delay))
            if not faults and delay > MOST_PERIODS * self.period:
                remedy = f"give at most {MOST_PERIODS * self.period:.9g} s, or a longer period"
                faults.add("delay", float(delay), f"is more than {MOST_PERIODS} periods", remedy)
        for section, base in SECTIONS.items():
            with faults.including():
                object.__setattr__(self, section, _parts(section, base, getattr(self, section)))
        if not faults and not self.laws:
            faults.add("laws", "", "are missing", "give at least one, such as lw.control.HeadingPID(kp=...)")
        if not faults:
            refuse_second([part for part in self.laws if isinstance(part, Callback)])
            self._check_wishes(faults)
            for part in self.sensors:
                part.check_used(faults, self.sensors)
        faults.raise_if_any()

    def _check_wishes(self, faults: Faults) -> None:
        """Add a fault for each quantity of the wanted motion that a part reads and no guidance sets."""
        wishes: set[str] = set()
        for part in (*self.guidance, *self.laws):
            for wish in part.needs:
                if wish not in wishes:
                    remedy = 'give guidance that wants it, such as [[controller.guidance]] type = "set_point"'
                    faults.add(part.section, part.key, f"needs a wanted {wish}, which no guidance gives", remedy)
            wishes |= set(part.gives)
        for law in (law for law in self.laws if law.foresees):
            for part in (part for part in self.guidance if not part.foreseeable):
                problem = f"looks ahead, and what {part.key} will want is not known"
                faults.add("laws", law.key, problem, "give a set_point or a trajectory, or leave preview out")

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts in the user's order, sensors first. Parts of a wired controller know their rows of the memory."""
        return tuple(part for section in SECTIONS for part in getattr(self, section))

    @property
    def delay_part(self) -> Delay:
        """The delay as a part; its key is "controller", like that of the section of the scene file."""
        part = Delay(name=self.key, period=self.period, delay=self.delay)
        object.__setattr__(part, "bus", self.bus)
        return part

    @property
    def acting_parts(self) -> tuple[Part, ...]:
        """The parts in the kernel's order: altimeters come first, because they measure from the true position.

        Faults of a sensor come directly after it, other faults after the delay.
        """
        callback, parts = self.callback, list[Part]()
        # The commands of a callback reach their actuator by an allocation of their own.
        idle = callback if callback is not None and callback.to else None
        others = (part for section in tuple(SECTIONS)[1:-1] for part in getattr(self, section) if part is not idle)
        for part in (*sorted(self.sensors, key=lambda sensor: not isinstance(sensor, Altimeter)), *others):
            of_sensor = (fault for fault in self.faults if getattr(fault, "sensor", None) and fault.of == part.key)
            parts += [part, *of_sensor]
        sent = tuple(part for part in self.faults if part not in parts)
        return (*parts, *((self.delay_part,) if self.bus.delayed else ()), *sent)

    @property
    def callback(self) -> Callback | None:
        """The law that is a Python function; None if there is none."""
        return next((part for part in self.laws if isinstance(part, Callback)), None)

    def parameters(self) -> dict[str, np.ndarray]:
        """The numbers that may vary by member.

        Returns:
            {name: number}: "controller.delay", and each number of a part as "key.field".
        """
        values = {f"{part.key}.{name}": value for part in self.parts for name, value in part.parameters().items()}
        return {f"{self.key}.delay": self.delay} | values

    def located(self, plane: LocalPlane | None) -> Controller:
        """The same controller, with the parts' geodetic points converted to positions in inertial axes.

        Args:
            plane: The plane of the scene's inertial axes on the Earth; None if the scene has no origin.

        Returns:
            A copy.

        Raises:
            SceneError: If a part has geodetic points and the scene has no origin.
        """
        located = copy.copy(self)
        faults = Faults("controller.")
        for section in SECTIONS:
            parts = list(getattr(self, section))
            for i, part in enumerate(parts):
                with faults.including():
                    parts[i] = part.located(plane)
            object.__setattr__(located, section, tuple(parts))
        faults.raise_if_any()
        return located

    def wired(
        self,
        terms: Sequence[Term],
        nominal: Mapping[str, np.ndarray] | None = None,
        events: Sequence[Event] = (),
    ) -> Controller:
        """The same controller, with parts that know their actuators and the rows of the memory.

        Args:
            terms: Terms of the scene.
            nominal: Numbers of the scene's vehicle and environment by name; none by default.
            events: Events of the scene; none by default.

        Returns:
            A copy.

        Raises:
            SceneError: If an allocation or a fault names a term that takes no commands, or the scene lacks something that a
                part needs. The message lists every fault.
        """
        faults = Faults("controller.")
        able = {term.key: term for term in terms if term.channels}
        allocation = self._allocation(faults, able)
        faults.raise_if_any()
        actuators = {key: term for key, term in able.items() if key in {part.to for part in allocation}}
        self._check_faults(faults, actuators)
        faults.raise_if_any()
        wired = copy.copy(self)
        object.__setattr__(wired, "allocation", tuple(part.informed(self.faults, self.asked) for part in allocation))
        object.__setattr__(wired, "actuators", actuators)
        object.__setattr__(wired, "laws", tuple(part.of_vehicle(nominal or {}) for part in self.laws))
        for section in ("sensors", "guidance", "laws"):
            known = (below(part.beside((*terms, *events)), terms) for part in getattr(wired, section))
            parts = tuple(part.in_scene(faults, events, wired.sensors) for part in known)
            object.__setattr__(wired, section, parts)
        faults.raise_if_any()
        channels = {key: term.channels for key, term in actuators.items()}
        callback = self.callback
        answers = 0 if callback is None else callback.answers(channels)
        shared = max(law.shared_rows for law in self.laws)
        altimeters = [part.key for part in self.sensors if isinstance(part, Altimeter)]
        watched = {(event.follows, event.type) for event in events}
        ending = [part.key for part in (*self.sensors, *self.guidance) if (part.key, part.ends) in watched]
        rows = (
            self.handed_rows,
            self.belief_rows,
            self.rejected_rows,
            any(part.iterates for part in wired.parts),
            ending,
        )
        controller = wired.on(Bus.of(channels, self.period, max(answers, shared), altimeters, *rows))
        for part in controller.allocation:
            part.check_actuator(faults)
        faults.raise_if_any()
        controller._check_laws(faults)
        faults.raise_if_any()
        return controller

    @property
    def asked(self) -> np.ndarray:
        """Six numbers for X Y Z K M N: 1 if some law demands the component, otherwise 0."""
        names = {name for law in self.laws for name in law.demands or COMPONENTS}
        return np.array([float(name in names) for name in COMPONENTS])

    @property
    def handed_rows(self) -> dict[str, int]:
        """Number of memory rows that each sensor passes to an estimator, by the sensor's key."""
        taken = {key for part in self.sensors for key in part.uses.values()}
        return {part.key: part.handed_rows for part in self.sensors if part.key in taken}

    @property
    def belief_rows(self) -> int:
        """Number of memory rows of the estimator's own state."""
        return sum(part.belief_rows for part in self.sensors)

    @property
    def rejected_rows(self) -> int:
        """Number of rows, among those of the estimator, that count the readings that the estimator's gate rejected."""
        return sum(part.rejected_rows for part in self.sensors)

    def _effect(self) -> np.ndarray:
        """Effect of all channels on the demanded components (6, channels); each column is scaled to length 1."""
        effect = self.asked[:, None] * np.concatenate([part.reach() for part in self.allocation], axis=1)
        sizes = np.linalg.norm(effect, axis=0)
        return np.asarray(effect / np.where(sizes > 0.0, sizes, 1.0))

    @property
    def unspanned(self) -> tuple[str, ...]:
        """Demanded components that the actuators cannot produce, or cannot produce independently of the others."""
        effect = self._effect()
        apart = np.eye(6) - effect @ np.linalg.pinv(effect, rcond=SPANNED)
        missed = self.asked * np.linalg.norm(apart, axis=0) > SPANNED
        return tuple(name for name, bad in zip(COMPONENTS, missed, strict=True) if bad)

    def undriven(self, terms: Sequence[Term]) -> tuple[str, ...]:
        """Keys of the terms that can take commands but get none: no allocation, command or schedule drives them.

        Args:
            terms: The terms of the scene.
        """
        return tuple(
            term.key for term in terms if term.channels and term.key not in self.actuators and not term.own_commands
        )

    def unread(self, terms: Sequence[Term]) -> tuple[tuple[Part, str], ...]:
        """Pairs (guidance, quantity), one for each wanted quantity if no law reads this or an equivalent quantity.

        A speed that guidance requires is left out if no actuator can produce a forward force and every term gets commands.

        Args:
            terms: The terms of the scene.
        """
        read = set(WISHES if self.callback is not None else ()).union(*(law.needs for law in self.laws))
        able = self.undriven(terms) or any(np.any(np.abs(part.reach()[0]) > SPANNED) for part in self.allocation)
        found: dict[str, Part] = {}
        for part in self.guidance:
            wanted = [wish for wish in READ_BY if wish in part.wanted]
            for wish in wanted:
                covered = wish not in PLAIN_WISHES and any(other in PLAIN_WISHES for other in wanted)
                forced = wish == "speed" and not able and not _chosen(part, wish)
                if not (covered or forced or READ_BY[wish] & read):
                    found[wish] = part
        return tuple((part, wish) for wish, part in found.items())

    @property
    def idle(self) -> tuple[str, ...]:
        """Keys of the actuators that cannot produce any demanded component."""
        parts = {part.to: part for part in self.allocation}
        return tuple(key for key in self.actuators if not np.any(self.asked[:, None] * parts[key].reach()))

    def _check_laws(self, faults: Faults) -> None:
        """Add a fault for each law if the actuators cannot produce any component of its demand."""
        idle = {name for name, row in zip(COMPONENTS, self._effect(), strict=True) if np.all(np.abs(row) < SPANNED)}
        for law in self.laws:
            wanted = law.demands or COMPONENTS
            if idle.issuperset(wanted):
                made_by = " and ".join(self.actuators)
                fault = f"asks for {', '.join(wanted)}, of which {made_by} can make nothing"
                faults.add("laws", law.key, fault, "give actuators that can, or leave the law out")

    def on(self, bus: Bus) -> Controller:
        """The same controller with another bus, the assignment of memory rows to its parts.

        Args:
            bus: The new assignment.

        Returns:
            A copy; its parts use this bus as well.
        """
        controller = copy.copy(self)
        object.__setattr__(controller, "bus", bus)
        actuators = {key: term.driven_by(bus) for key, term in self.actuators.items()}
        object.__setattr__(controller, "actuators", actuators)
        others = {**actuators, **{part.key: part for part in self.sensors}}
        for section in SECTIONS:
            parts = tuple(part.wired(bus, others) for part in getattr(self, section))
            object.__setattr__(controller, section, parts)
        return controller

    def _allocation(self, faults: Faults, able: Mapping[str, Term]) -> tuple[Allocation, ...]:
        """The given or the default allocation, after checks."""
        parts = tuple(self.allocation)
        if self.callback is not None and (keys := self.callback.targets):
            own = (CallbackCommands(to=key, before=keys[:i]) for i, key in enumerate(keys))
            parts = (*own, *(part for part in parts if part.type))
        if not parts:
            if len(able) != 1:
                if able:
                    which = " or ".join(map(repr, able))
                    faults.add("allocation", "", "is missing", f"give [[controller.allocation]] to = {which}")
                else:
                    faults.add("controller", "", "moves nothing: no term of the scene takes commands", ACTUATOR)
                return ()
            parts = (PseudoInverse(to=next(iter(able))),)
        wrong = [part.to for part in parts if not isinstance(part.to, str)]
        for value in wrong:
            faults.add("allocation.to", value, "is not a text", "give the name of a term that takes commands")
        if wrong:
            return ()
        counts = Counter(part.to for part in parts)
        for part in parts:
            if part.to not in able:
                remedy = closest(part.to, able) if able else ACTUATOR
                faults.add("allocation.to", part.to, "is not a term that takes commands", remedy)
            elif able[part.to].own_commands:
                problem = "has commands of its own"
                faults.add("allocation.to", part.to, problem, f"leave {part.to}.command and its schedule out")
        for key in (key for key, count in counts.items() if count > 1):
            faults.add("allocation.to", key, f"is named by {counts[key]} allocations", "keep one of them")
        return parts

    def _check_faults(self, faults: Faults, actuators: Mapping[str, Term]) -> None:
        handed, least = self.handed_rows, MOST_PERIODS * self.period
        counts = {part.key: part.fault_channels(part.key in handed) for part in self.sensors}
        counts = {key: count for key, count in counts.items() if count}
        counts |= {key: term.channels for key, term in actuators.items()}
        for part in (part for part in self.faults if isinstance(part, Fault)):
            key, count = f"{part.key}.channel", counts.get(part.of, 0)
            if part.delay > least:
                problem, remedy = f"is more than {MOST_PERIODS} periods", f"give at most {least:.9g} s"
                faults.add(f"{part.key}.delay", float(part.delay), problem, remedy)
            if part.of not in counts:
                remedy = closest(part.of, counts)
                faults.add(f"{part.key}.of", part.of, "is not an actuator and no sensor of this controller", remedy)
            elif part.channel != ALL and not 0 <= int(part.channel) < count:
                remedy = f"give 0 to {count - 1}" if count > 1 else "give 0"
                faults.add(key, part.channel, f"is beyond the {count} of {part.of}", remedy)

    def every(self, h: float) -> int:
        """Number of steps between two ticks.

        docs/theory/control_loop.md, (C1).

        Args:
            h: Step of the run [s].

        Returns:
            The whole number nearest to period / h, at least 1.
        """
        return max(1, round(self.period / h))

    def check_step(self, faults: Faults, h: float, asked: float | None = None) -> None:
        """Add a fault if the period or the delay is not a whole number of steps.

        Args:
            faults: Collects the faults.
            h: Step of the run [s].
            asked: The requested step [s], if the end of the run or a sample time shortened it; by default None.
        """
        for name, value in (("period", float(self.period)), ("delay", float(self.delay))):
            if _is_whole(name, value, h):
                continue
            low = int(value / h + ROUND_OFF)
            near = " or ".join(f"{max(i, 1) * h:.9g}" for i in sorted({max(low, 1), low + 1}))
            problem, remedy = f"is not a whole number of steps of {h:.9g} s", f"give {near} s, or another step"
            if asked is not None:
                problem += f", which the end of the run and its sample times have made of {asked:.9g} s"
                if _is_whole(name, value, asked):
                    remedy = f"give an end and sample times that are whole numbers of {asked:.9g} s, or another step"
            faults.add(f"controller.{name}", value, problem, remedy)

    def to_dict(self) -> dict[str, Any]:
        """The controller as the section of a scene file.

        Returns:
            The period, the delay, and the lists that are not empty.
        """
        content: dict[str, Any] = {"period": float(self.period)}
        content |= {"delay": float(self.delay)} if self.delay else {}
        lists = {section: [part.to_dict() for part in getattr(self, section) if part.type] for section in SECTIONS}
        return content | {section: parts for section, parts in lists.items() if parts}


def from_table(table: Any) -> Controller | None:
    """The controller of a scene, given as a Controller or as the section of a scene file; None for None."""
    if table is None:
        return None
    example = "write [controller] and its keys below, or give lw.Controller(...)"
    return declared.from_table(Controller, "controller", table, example, period="give the time between two ticks [s]")


def terms_of(scene: Mapping[str, Any]) -> tuple[Term, ...]:
    """The terms of a scene from its content; each knows its vehicle and whether a controller drives it.

    The controller itself is not built, because a law may be a function of which the content has only the name.
    """
    terms, table = from_list(scene.get("terms", ())), scene.get("controller")
    lists = (table.get(section) for section in ("laws", "allocation")) if isinstance(table, Mapping) else ()
    parts = [part for entries in lists if isinstance(entries, list) for part in entries if isinstance(part, Mapping)]
    actuators = {to for part in parts if isinstance(to := part.get("to"), str)}
    bus = Bus.of({term.key: term.channels for term in terms if term.key in actuators}, 1.0)
    wired = (term.driven_by(bus if term.key in actuators else None) for term in terms)
    body = Vehicle(**scene["vehicle"]) if "vehicle" in scene else None
    numbers = {f"vehicle.{name}": value for name, value in body.parameters().items()} if body else {}
    return tuple(term.of_vehicle(numbers) if body else term for term in wired)


def _parts(section: str, base: type[Part], entries: Any) -> tuple[Part, ...]:
    """The parts of one list, from objects or tables."""
    entries = check_list(section, entries, f"write [[controller.{section}]] and type = ... below")
    faults, parts = Faults(), []
    known = base.kinds
    for i, entry in enumerate(entries):
        where = f"{section}[{i}]"
        with faults.including():
            if isinstance(entry, Mapping):
                word = entry.get("type", "fault" if section == "faults" else "")
                if not isinstance(word, str) or word not in known:
                    faults.add(f"{where}.type", word, "is not known", closest(str(word), known))
                else:
                    parts.append(build(where, known[word], entry))
            elif isinstance(entry, base):
                parts.append(entry)
            else:
                faults.add(where, entry, "is not a part of this list", f"give one of {', '.join(known)}")
    faults.raise_if_any()
    return tuple(parts)


def _is_whole(name: str, value: float, h: float) -> bool:
    """Whether a period or a delay [s] is a whole number of steps; a period must have at least one."""
    return (name == "delay" or value >= 0.5 * h) and whole_steps(value, h) is not None


def _chosen(part: Part, name: str) -> bool:
    """Whether the user gave a part an optional number."""
    optional = any(item.name == name and item.default is None for item in fields(part))
    return optional and getattr(part, name) is not None
