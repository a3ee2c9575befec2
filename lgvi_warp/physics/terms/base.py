# SPDX-License-Identifier: Apache-2.0
"""The base class of every term: checked numbers with units that may vary by member, and their packing for the kernel."""

from __future__ import annotations

import copy
import dataclasses
import functools
import keyword
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from lgvi_warp.common import names, registry
from lgvi_warp.common.arguments import explained, items_of
from lgvi_warp.common.declared import read
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults, SceneError, ragged, refusal
from lgvi_warp.common.real_numbers import settle, settles_first
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.notation import repeated

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import GivenDraws

# A term's own numbers, or all parameters of a scene, by name; leading dimension 1 (shared) or n (one per member).
Array = np.ndarray
Numbers = Mapping[str, Array]

# What a motion can conserve: energy [J], horizontal linear momentum [N s], vertical angular momentum [N m s].
CONSERVED = frozenset({"energy", "horizontal_momentum", "vertical_angular_momentum"})


@dataclass(frozen=True)
class PackingContext:
    """Inputs of a term when it packs its numbers for the device: the scene's parameters, the frame, the run.

    Args:
        parameters: All parameters of the scene by name ("vehicle.mass"), each of shape (1, ...) or (n, ...).
        frame: Axes and origins of the vehicle in the kernel; forces act about `frame.forces`.
        members: Indices of the members, shape (n,).
        seed: Seed of the ensemble.
        h: Step [s].
        aligned: Whether all members of the run have the user's axes in the kernel, up to order and sign, and the user's
            origin for the forces; False by default.
        time: Time at which the members start or continue a run [s]; 0 by default.
        remembered: Memory of the term, (n, rows) as in `Packed.memory`, if members continue a run; otherwise None (default).
        given: Standard normal numbers that the caller of a prepared run passes; None, the default, if the kernel draws them.
    """

    parameters: Numbers
    frame: Frame
    members: np.ndarray
    seed: int
    h: float
    aligned: bool = False
    time: float = 0.0
    remembered: np.ndarray | None = None
    given: GivenDraws | None = None

    def own(self, term: Term) -> dict[str, np.ndarray]:
        """The numbers of one term.

        Args:
            term: A term of the scene.

        Returns:
            The term's numbers by field, each of shape (1, ...) or (n, ...).
        """
        return own(term, self.parameters)


# Units of an actuator, at most, whose code is written out one by one; of more it is one loop.
MOST_UNROLLED = 12


class Packed(NamedTuple):
    """A term's numbers in the form that its device code reads; the leading dimension n is 1 if all members share them.

    Args:
        values: The fields of the device struct by name: numbers (n,), vectors (n, 3) in the kernel's axes, one whole number,
            or whole numbers (n,).
        rows: The term's rows of the device table, shape (n, rows), or several such arrays, which are joined along the rows.
            Each array may have the leading dimension 1 (shared) or n. None for no rows.
        memory: The term's memory at the start, which it keeps from step to step, shape (n, rows); None for no memory.
        work: Number of scratch rows that the device code may overwrite during one call.
        normals: Standard normal numbers that the caller of a prepared run passes (draws="given"), shape (n, rows). In the
            table they follow the term's own rows; the field `key` of the struct refers to them. None for no such numbers.
    """

    values: dict[str, Any]
    rows: np.ndarray | tuple[np.ndarray, ...] | None = None
    memory: np.ndarray | None = None
    work: int = 0
    normals: np.ndarray | None = None


class Inner(NamedTuple):
    """Contribution of a mass that moves in the vehicle to the vehicle's momenta and energy, each (k, n, ...).

    Args:
        momenta: Linear and angular momentum about the body's origin, (k, n, 6) [N s, N m s], body axes.
        kinetic: Kinetic energy (k, n) [J].
        potential: Potential energy (k, n) [J].
    """

    momenta: np.ndarray
    kinetic: np.ndarray
    potential: np.ndarray


def number(
    shape: tuple[Any, ...],
    unit: str,
    default: Any = dataclasses.MISSING,
    least: float = -np.inf,
    most: float = np.inf,
    *,
    above: float = -np.inf,
    rising: bool = False,
    axes: str | None = None,
    optional: bool = False,
    infinite: bool = False,
    integer: bool = False,
) -> Any:
    """Declare a numeric field of a term.

    Args:
        shape: Shape of the field. It may contain a name such as "k", for a length that is free but equal in all fields that
            use the same name.
        unit: Unit of the field in error messages; "1" for no unit.
        default: Value if the user gives none; without a default the field is required.
        least: Smallest allowed value, in the field's unit.
        most: Largest allowed value, in the field's unit.
        above: Bound that every value must exceed, in the field's unit.
        rising: Whether the values must rise, like the depths of a table; False by default.
        axes: Conversion by `Term.packed` for the device. "vector": a vector in body axes is converted to the kernel's axes.
            "point": a point of the body is also shifted to the origin of the forces. None, the default: no conversion, for
            numbers without axes or in inertial axes.
        optional: Whether the field may be None after construction; it is then not a parameter. False by default.
        infinite: Whether the values may be infinite; False by default.
        integer: Whether the values must be whole numbers, like counts; False by default.

    Returns:
        A dataclass field with shape, unit, bounds and axes in its metadata.

    Raises:
        ValueError: If `axes` has another value.
    """
    if axes not in ("vector", "point", None):
        raise ValueError(f"axes = {axes!r} is not known. Give 'vector', 'point' or None")
    meta = dict(shape=shape, unit=unit, least=least, most=most, above=above, rising=rising, axes=axes)
    return field(default=default, metadata=meta | dict(optional=optional, infinite=infinite, integer=integer))


def word_of(item: dataclasses.Field[Any]) -> str:
    """The name of a field in scene files, parameters and error messages."""
    word = item.name.removesuffix("_")
    return word if keyword.iskeyword(word) else item.name


@functools.cache
def _number_fields(kind: Any) -> tuple[dataclasses.Field[Any], ...]:
    """The number fields of a class, cached because each pass over a term's numbers needs them."""
    return tuple(item for item in dataclasses.fields(kind) if "shape" in item.metadata)


@explained
@dataclass(frozen=True, eq=False, kw_only=True)
class Term(Documented):
    """Base class of terms: a force, a moment or a motion of the water in a scene.

    Fields declared by `number` are arrays after construction.

    docs/develop/add_a_force.md shows how to write a term. The attributes and methods are for authors of terms.

    Args:
        name: Name of the term in parameters ("name.field"), to distinguish two terms of one type; by default the type.

    Attributes:
        type: Name in a scene file; files can use it as soon as the class is defined.
        device: Name of a module of lgvi_kernels.laws (by default the type), path of an extension's module, or any object with
            the same functions.
        timed: Whether the law depends on time.
        dissipative: Whether the term's damping never creates energy.
        brakes: Whether the term removes energy overall, even if some motions gain energy.
        strengths: Names of numbers; the term has no effect if all of these are 0.
        carries: Whether the term is a current that is the same everywhere and at all times, which exerts no force.
        carried: Whether the term changes the vehicle's inertia in time.
        anchored: Whether the term ties the vehicle to a fixed point, so that a current does work.
        accounted: Whether the scene has an account of the energy used (`EnergyUse`).
        memory_rows: Number of rows of memory, which start as zeros, of a term that does not define `packed`.
        key: Name in parameters: `name`, or the type.
        conserves: Quantities that a motion conserves if only this term acts.

    Methods:
        parameters: The numbers that may vary by member.
        number_fields: The fields declared by `lw.laws.number`.
        check: Add faults for invalid numbers.
        beside: The same term, with access to the other terms of its scene.
        packed: The numbers for the device code.
        potential: Potential energy, for a law that has one.
        water: Velocity of the water, for a term that moves it.
        inner: Momenta and energy of masses that move in the vehicle.
        to_dict: The term as a table of a scene file.

    Raises:
        SceneError: If a number has the wrong shape, is not finite or is out of bounds. The message lists every fault.
    """

    type: ClassVar[str] = ""
    # Classes by their type in a scene file; events have a table of their own.
    kinds: ClassVar[registry.Kinds] = registry.Kinds("lgvi_warp.physics.terms", {}, "terms")
    # Whether it acts on the motion: an event does not.
    acts: ClassVar[bool] = True
    device: ClassVar[Any] = ""
    timed: ClassVar[bool] = False
    dissipative: ClassVar[bool] = True
    brakes: ClassVar[bool] = False
    # Numbers without which it does nothing: it is absent where all of them are zero. None named: it always acts.
    strengths: ClassVar[tuple[str, ...]] = ()
    carries: ClassVar[bool] = False
    # Whether it changes the vehicle's inertia in time: only methods that take another inertia at each stage can have it.
    carried: ClassVar[bool] = False
    anchored: ClassVar[bool] = False
    # Device code of its exact flow, a sub-map of its own: for axes that are principal ones, and for any, one after the other.
    # None named: it has none. `Drag` has the methods that go with it.
    exact_flow: ClassVar[tuple[str, ...]] = ()
    # Device code that is made for the entries of the term's matrices that are not zero (see `entries`): in the user's axes.
    pattern_device: ClassVar[str] = ""
    # The bus of a controller that drives it (see lgvi_warp/control), and the numbers that then do not act.
    driver: ClassVar[Any] = None
    driven_fields: ClassVar[tuple[str, ...]] = ()
    # Whether it keeps the account of the energy used; whether some term of its scene does, so that its power is asked for;
    # whether an event looks at that energy.
    accounts: ClassVar[bool] = False
    accounted: ClassVar[bool] = False
    looks_at_energy: ClassVar[bool] = False
    # Whether a scene has one of its kind at most.
    unique: ClassVar[bool] = False
    # Fields that follow from another one, of which alone a fault is told; set by a term before its fields are checked.
    following: ClassVar[tuple[str, ...]] = ()
    # Numbers with whose sizes the diagonal of `braking` grows, as it does with the speeds and the density where there are any.
    braking_grows_with: ClassVar[tuple[str, ...]] = ()
    # Rows of memory, at first 0, that the device code of a term has which does not define `packed`.
    memory_rows: ClassVar[int] = 0
    # For checks of what is plausible: the largest usual size of a number and why, or why it has none ("": of all numbers); the
    # number that holds depths; whether the vehicle loses buoyancy above the surface by this term.
    usual: ClassVar[Mapping[str, str | tuple[float, str]]] = {}
    depth_field: ClassVar[str] = ""
    floats: ClassVar[bool] = False
    # Whether it looks at the depth below the surface, and the term that moves that; set for a term of a scene.
    looks_at_surface: ClassVar[bool] = False
    surface_level: ClassVar[Any] = None
    # Numbers in (0, 1) that each member of an ensemble draws by itself, unless they vary otherwise.
    drawn: ClassVar[tuple[str, ...]] = ()

    name: str = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        settles_first(cls)
        if cls.__module__.startswith(__package__.partition(".")[0]):
            explained(cls)
        cls.device = cls.device or cls.type
        registry.add(cls.kinds, cls)

    def __post_init__(self) -> None:
        settle(self)
        faults = Faults(f"{self.key}.")
        if not isinstance(self.name, str):
            faults.add("name", self.name, "is not a text", "give a name, or leave it out")
        elif self.key and (wrong := names.wrong_with(self.key)):
            faults.add("name" if self.name else "type", self.key, *wrong)
        lengths: dict[str, int] = {}
        for item in self.number_fields():
            value, field_faults = getattr(self, item.name), Faults() if item.name in self.following else faults
            object.__setattr__(self, item.name, _checked(field_faults, item, value, lengths, self.shape_of(item)))
        if not faults:
            read(self, faults)
        if not faults:
            self.check(faults)
        faults.raise_if_any()

    @classmethod
    def number_fields(cls) -> tuple[dataclasses.Field[Any], ...]:
        """The fields that hold numbers.

        Returns:
            The dataclass fields declared by `number`, in the order of the class.
        """
        return _number_fields(cls)

    def shape_of(self, item: dataclasses.Field[Any]) -> tuple[Any, ...]:
        """The shape of a numeric field of this object.

        Args:
            item: The field.

        Returns:
            The shape; by default the one that the class declares.
        """
        shape: tuple[Any, ...] = item.metadata["shape"]
        return shape

    @classmethod
    def lanes(cls) -> tuple[tuple[str, int], ...] | None:
        """The numbers as fields of a device struct that is generated from them.

        Returns:
            (name, length) of each number, with length 1 for the shape () and 3 for (3,). None if a number has another shape.
        """
        lengths = {(): 1, (3,): 3}
        shapes = {item.name: item.metadata["shape"] for item in cls.number_fields()}
        simple = all(shape in lengths for shape in shapes.values())
        return tuple((name, lengths[shape]) for name, shape in shapes.items()) if simple else None

    @property
    def unused(self) -> tuple[str, ...]:
        """Numbers without effect: the commands of a term that a controller drives."""
        return self.driven_fields if self.driver is not None else ()

    def driven_by(self, bus: Any) -> Any:
        """The same term, with the commands of a controller.

        Args:
            bus: Rows of the memory with the commands; None for no controller.

        Returns:
            A copy, or the term itself if nothing changes.
        """
        if bus is None and self.driver is None:
            return self
        term = copy.copy(self)
        object.__setattr__(term, "driver", bus)
        return term

    def of_vehicle(self, numbers: Numbers) -> Any:
        """The same term, with access to the vehicle of its scene.

        Args:
            numbers: The numbers of the vehicle and its environment by name, each in its own shape.

        Returns:
            A copy; by default the term itself.

        Raises:
            SceneError: If the term does not fit this vehicle.
        """
        return self

    def beside(self, terms: Sequence[Term]) -> Any:
        """The same term, with access to the other terms of its scene, for a term that depends on them.

        Args:
            terms: All terms and events of the scene.

        Returns:
            A copy, or the term itself if nothing changes, which is the default.
        """
        return self

    def beside_account(self, accounted: bool) -> Any:
        """The same term, in a scene that does or does not account the energy used.

        Args:
            accounted: Whether the scene accounts the energy used.

        Returns:
            A copy, or the term itself if nothing changes.
        """
        if accounted == self.accounted:
            return self
        term = copy.copy(self)
        object.__setattr__(term, "accounted", accounted)
        return term

    @property
    def channels(self) -> int:
        """Number of commands that the term takes from a controller; 0, the default, if it takes none."""
        return 0

    @property
    def own_commands(self) -> bool:
        """Whether the term has its own commands, which no controller may replace; by default False."""
        return False

    @property
    def key(self) -> str:
        """The name by which parameters refer to this term: its `name`, or its `type` if it has no name."""
        return self.name if isinstance(self.name, str) and self.name else self.type

    def repeat(self, count: int, *names: str) -> None:
        """Repeat a single value of a field for every row; for use before the fields are checked.

        Args:
            count: Number of rows.
            names: Fields with one number for each row.
        """
        for name in names:
            value = getattr(self, name)
            if value is not None and np.ndim(np.asarray(value, dtype=object)) == 0:
                object.__setattr__(self, name, np.array([value] * count))

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        """The same term with other values of some fields.

        Args:
            fields: Values by the field's name.

        Returns:
            A new term.

        Raises:
            SceneError: If a value is invalid.
        """
        faults = Faults()
        faults.keys(self.key, fields, [item.name for item in dataclasses.fields(self) if item.init])
        faults.raise_if_any()
        return dataclasses.replace(self, **fields)

    def check(self, faults: Faults) -> None:
        """Add a fault for each number that is invalid although its shape and bounds are right; by default there is none.

        Args:
            faults: Collects the faults. The method is called only if all shapes and bounds are right.
        """

    def parameters(self) -> dict[str, np.ndarray]:
        """The numbers that may vary by member.

        Returns:
            The array of each numeric field, by the field's name, in the field's own shape.
        """
        return {
            word_of(item): getattr(self, item.name)
            for item in self.number_fields()
            if getattr(self, item.name) is not None and item.name not in self.unused
        }

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """Members with numbers that the term refuses: not finite, or out of bounds.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            {numeric field: mask (n,)}, True for a member whose number is refused.
        """
        fields = {word_of(item): item for item in self.number_fields()}
        return {
            name: _outside(fields[name], value) | _falling(fields[name], value) | _fractional(fields[name], value)
            for name, value in numbers.items()
        }

    def odd_at(self, numbers: Numbers, position: Array) -> Mapping[str, tuple[Array, str]]:
        """Implausible numbers of members at their start positions; none by default.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            position: Positions (n, 3) [m].

        Returns:
            {field: (mask of the members concerned (n,), reason)}; the text `reason` has {} in the place of the depth.
        """
        return {}

    def present(self, numbers: Numbers) -> bool:
        """Whether the term acts on any member. By default it does if it has no `strengths`, or if one of them is not 0.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            False if the term has no effect; the kernel then leaves its code out.
        """
        return not self.strengths or any(np.any(numbers[name]) for name in self.strengths)

    @property
    def memory(self) -> bool:
        """Whether the term's device code keeps a memory from step to step."""
        return self.memory_rows > 0

    @property
    def conserves(self) -> frozenset[str]:
        """Quantities, among those in `CONSERVED`, that a motion conserves if only this law acts.

        By default a law conserves energy if its device code is POTENTIAL without other roles, its class defines `potential`,
        and it is not `timed` and has no memory. Other laws conserve nothing by default. If the potential depends only on depth
        and attitude relative to the vertical, the law conserves all three quantities; its author should override this.
        """
        device = self.device
        follows = getattr(device, "POTENTIAL", False) and type(self).potential is not Term.potential
        others = ("damping", "flow", "evolve", "seeing", "carried_inertia")
        more = self.timed or self.memory or any(hasattr(device, role) for role in others)
        return frozenset({"energy"} if follows and not more else ())

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings about implausible numbers, for `lgvi-warp check` and the messages of a run; by default none."""
        return ()

    @property
    def own_events(self) -> tuple[Any, ...]:
        """Events that the term adds to its scene; by default none."""
        return ()

    def check_times(self, faults: Faults, first: float, last: float) -> None:
        """Add a fault if the term has no data for a part of the run; by default there is none.

        Args:
            faults: Collects the faults.
            first: Start of the run [s].
            last: End of the run [s].
        """

    def entries(self, numbers: Numbers) -> tuple[str, ...]:
        """The nonzero entries of the term's matrices in some member, for a term with a `pattern_device`.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            Words for the device code: "q01" stands for row 0 and column 1 of the matrix q. By default none.
        """
        return ()

    def device_in(self, aligned: bool) -> Any:
        """The device code for the axes of this run.

        Args:
            aligned: As in `PackingContext`: whether the kernel's axes and origin are the user's.

        Returns:
            The name of a module of lgvi_kernels.laws, the path of another module, or an object with the same functions.
        """
        return self.device

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """Pack the term's numbers for its device code, in the kernel's axes.

        By default each number becomes a field of the struct, converted according to its `axes`.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...); n = 1 if members share them.
            context: The scene's parameters, the frame and the run.

        Returns:
            The fields of the device struct, and the rows, memory and scratch rows that the device code needs.

        Raises:
            NotImplementedError: If the term does not define this method and has a number of another shape than () and (3,).
        """
        if self.lanes() is None:
            name = type(self).__name__
            raise NotImplementedError(f"{name} must define packed(numbers, context): see docs/develop/add_a_force.md")
        frame = context.frame
        # An event sees the body's origin, whatever that of the forces is.
        point = frame.point if self.acts else frame.vector
        turned: dict[str | None, Any] = {"vector": frame.vector, "point": point, None: np.asarray}
        values = {item.name: turned[item.metadata["axes"]](numbers[word_of(item)]) for item in self.number_fields()}
        return Packed(values, memory=self.first_memory)

    @property
    def first_memory(self) -> np.ndarray | None:
        """The memory at the start, with `memory_rows` rows of 0; None without memory."""
        return np.zeros((1, self.memory_rows)) if self.memory_rows else None

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray | None:
        """Velocity of the water due to this term; by default None.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            position: Positions (k, n, 3) [m] in inertial axes.
            time: Times (k,) [s].
            parameters: All parameters of the scene, by name.

        Returns:
            Velocity (k, n, 3) [m/s] in inertial axes. None for a law that moves no water, or if the velocity is not known
            after the run.
        """
        return None

    def water_at_start(self, numbers: Numbers, position: np.ndarray, context: PackingContext) -> np.ndarray:
        """Velocity of the water where the members start or continue; by default the result of `water` at that time.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            position: Positions (n, 3) [m] at the start, in inertial axes.
            context: The scene's parameters, the frame and the run.

        Returns:
            Velocity (n, 3) [m/s] in inertial axes.
        """
        still = self.water(numbers, position[None], np.array([context.time]), context.parameters)
        return np.zeros_like(position) if still is None else still[0]

    def braking(self, numbers: Numbers, speeds: Array, water_density: Array) -> Array:
        """Damping matrix of the term at given speeds: minus the derivative of its wrench by the velocity, or a bound on it.

        A run without a given method uses this matrix to choose a stable method (lgvi_warp.runs.default_method).

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            speeds: Sizes of velocity and angular velocity along and about the body's axes, (n, 6) [m/s, rad/s].
            water_density: Density of the water, (n,) [kg/m3].

        Returns:
            Matrices (n, 6, 6) [N s/m, N s, N m s], user's axes and origin.

        Raises:
            NotImplementedError: If the term does not define this method; its damping then counts as strong.
        """
        raise NotImplementedError(f"{type(self).__name__} does not tell how strongly it brakes")

    def effect(self, numbers: Numbers, parameters: Numbers, speed: Array) -> Array:
        """Wrench of one unit of effort of each channel. An effort is the thrust of a thruster or the angle of a fin.

        Args:
            numbers: The term's numbers by field, each of shape (1 or n, ...).
            parameters: All parameters of the scene, by name.
            speed: Forward speed (1 or n,) [m/s].

        Returns:
            Wrenches (1 or n, 6, channels) about the body's origin [N, N m per unit of effort].

        Raises:
            NotImplementedError: If the term does not define this method, which `PseudoInverse` needs of an actuator.
        """
        raise NotImplementedError(f"{type(self).__name__} does not tell what its channels make")

    def drive(self) -> Array:
        """Largest force and torque with which the term drives the vehicle in any motion, with the scene's numbers.

        Returns:
            Sizes along and about the body's axes (6,) [N, N m]; by default zero.
        """
        return np.zeros(6)

    def potential(self, numbers: Numbers, position: Array, attitude: Array, parameters: Numbers) -> Array | float:
        """Potential energy of the term at sampled states.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            position: Positions (k, n, 3) [m] in inertial axes.
            attitude: Attitudes (k, n, 3, 3), body to inertial axes.
            parameters: All parameters of the scene, by name.

        Returns:
            Energy (k, n) [J]; 0 for a term without a potential.
        """
        return 0.0

    def inner(self, numbers: Numbers, time: Array, twist: Array, down: Array, parameters: Numbers) -> Inner | None:
        """Contribution of a mass that moves in the vehicle to momenta and energy at sampled states.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            time: Times (k,) [s].
            twist: Velocities (nu; Om) through the water, (k, n, 6) [m/s, rad/s], body axes about the body's origin.
            down: The vertical in body axes, (k, n, 3).
            parameters: All parameters of the scene, by name.

        Returns:
            The additions to the values of a vehicle with constant inertia. None, the default, if there are none or they are
            not known.
        """
        return None

    def to_dict(self) -> dict[str, Any]:
        """The term as a table of a scene file.

        Returns:
            `type`, `name` if given, and every field that is not None; arrays become lists.
        """
        return self.table_without(())

    def table_without(self, names: Collection[str]) -> dict[str, Any]:
        """The table of `to_dict` without some fields, whose arrays are then not converted to lists.

        Args:
            names: Names of the fields to leave out.

        Returns:
            The table, as `to_dict` returns it, without these fields.
        """
        content: dict[str, Any] = {"type": self.type} | ({"name": self.name} if self.name else {})
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if item.name not in ("name", *names) and value is not None:
                content[word_of(item)] = value.tolist() if isinstance(value, np.ndarray) else value
        return content


def own(term: Term, parameters: Numbers) -> dict[str, np.ndarray]:
    """The numbers of one term by field, selected from those of a scene by name."""
    return {name: parameters[f"{term.key}.{name}"] for name in term.parameters()}


def _checked(
    faults: Faults, field: dataclasses.Field[Any], value: Any, lengths: dict[str, int], shape: tuple[Any, ...]
) -> np.ndarray | None:
    """The value of a field as an array of this shape; None after adding a fault."""
    meta, name = field.metadata, word_of(field)
    if value is None and meta["optional"]:
        return None
    unit = meta["unit"]
    if any(isinstance(size, str) for size in shape):
        array = faults.finite(name, value, None, unit)
        if array is None:
            return None
        wanted = tuple(lengths.get(size, size) if isinstance(size, str) else size for size in shape)
        pairs = zip(wanted, array.shape, strict=False)
        fits = array.ndim == len(shape) and all(isinstance(want, str) or want == size for want, size in pairs)
        if not fits or 0 in array.shape:
            text = " x ".join(str(size) for size in wanted)
            faults.add(name, value, f"has shape {array.shape}", f"give {text} numbers [{unit}]")
            return None
        lengths |= {size: got for size, got in zip(shape, array.shape, strict=True) if isinstance(size, str)}
    elif meta["infinite"]:
        array = faults.real(name, value)
        if array is not None and array.shape != shape:
            faults.add(name, value, f"has shape {array.shape}", f"give {_amount(shape)} [{unit}]")
            return None
    else:
        array = faults.finite(name, value, shape, unit)
    if array is None:
        return None
    if _outside(field, array[None]).any():
        words = ((meta["above"], "above"), (meta["least"], "from"), (meta["most"], "to"))
        bounds = " ".join(f"{word} {bound:g}" for bound, word in words if np.isfinite(bound))
        problem = "is not positive" if meta["above"] == 0.0 and np.any(array <= 0.0) else "is out of bounds"
        faults.add(name, value, problem, f"give numbers {bounds} [{unit}]")
    elif np.any(_falling(field, array[None])):
        faults.add(name, value, "is not rising", "sort the table and drop repetitions")
    elif np.any(_fractional(field, array[None])):
        faults.add(name, value, "is not a whole number", f"give {_whole_near(array, meta)}")
    else:
        return array
    return None


def _amount(shape: tuple[Any, ...]) -> str:
    """Text that states how many numbers a shape has."""
    return f"numbers of shape {shape}" if shape else "a number"


def _outside(field: dataclasses.Field[Any], values: np.ndarray) -> np.ndarray:
    """Mask (n,) of the members whose values (n, ...) of a field are not finite, or out of its bounds."""
    flat, meta = values.reshape(len(values), -1), field.metadata
    if flat.size:
        low, high = flat.min(), flat.max()  # NaN if any is
        finite = np.isfinite(low) and np.isfinite(high)
        if finite and meta["least"] <= low and meta["above"] < low and high <= meta["most"]:
            return np.zeros(len(values), bool)
    with np.errstate(invalid="ignore"):
        inside = (flat >= meta["least"]) & (flat <= meta["most"]) & (flat > meta["above"])
    return ~np.all((np.isfinite(flat) | meta["infinite"]) & inside, axis=1)


def _falling(field: dataclasses.Field[Any], values: np.ndarray) -> Any:
    """Mask (n,) of the members whose values (n, k) of a field must rise but do not; False if they need not rise."""
    if not field.metadata["rising"]:
        return False
    return np.any(np.diff(np.nan_to_num(values)) <= 0.0, axis=1)


def _fractional(field: dataclasses.Field[Any], values: np.ndarray) -> Any:
    """Mask (n,) of the members whose values (n, ...) of a field must be whole but are not; False if they need not be."""
    if not field.metadata["integer"]:
        return False
    return np.any(values.reshape(len(values), -1) != np.rint(values.reshape(len(values), -1)), axis=1)


def _whole_near(array: np.ndarray, meta: Mapping[str, Any]) -> str:
    """The whole numbers nearest to a single number, within its bounds, as a remedy; a general text for several numbers."""
    if array.ndim:
        return "whole numbers"
    near = {float(value) for value in (np.floor(array), np.ceil(array)) if meta["least"] <= value <= meta["most"]}
    return " or ".join(f"{value:g}" for value in sorted(near))


def knots(at: np.ndarray, values: np.ndarray, steps: bool = False) -> np.ndarray:
    """Rows of a table that the device reads by `table1` and `table3`: linear between its knots, constant outside.

    Args:
        at: Arguments at the knots (1 or n, k), rising, in the unit of the table's argument; k is 2 or more.
        values: Values at the knots, (1 or n, k, 1) for `table1`, (1 or n, k, 3) for `table3`.
        steps: Whether each value is constant up to the next knot, and then jumps; False by default.

    Returns:
        Rows (1 or n, d + (k - 1) (d + 2)), where a value has d numbers: the first value, then for each interval its start,
        1 / length and the change of the value. `table1` and `table3` take k - 1, the number of intervals, as their count.

    Raises:
        SceneError: If `at` or `values` are not numbers of these shapes.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> depths, speeds = np.array([[0.0, 10.0, 30.0]]), np.array([[[0.5], [0.3], [0.0]]])
        >>> lw.laws.knots(depths, speeds).round(3).tolist()
        [[0.5, 0.0, 0.1, -0.2, 10.0, 0.05, -0.3]]
    """
    faults, arrays = Faults(), dict[str, Any]()
    for key, value, size in (("at", at, 2), ("values", values, 3)):
        arrays[key] = found = faults.real(key, value)
        if found is not None and (found.ndim != size or found.size == 0):
            faults.add(key, value, f"has shape {found.shape}", f"give numbers of {size} dimensions, two knots or more")
    if not isinstance(steps, bool | np.bool_):
        faults.add("steps", steps, "is neither True nor False", "say whether values hold up to the next knot")
    faults.raise_if_any()
    at, values = arrays.values()
    if len(at) != len(values) and 1 not in (len(at), len(values)):
        raise refusal("values", values, f"are of {len(values)} members", f"give 1, or {len(at)}")
    at, values = repeated(at, values)
    if at.shape[1] != values.shape[1]:
        raise refusal("values", values, f"are at {values.shape[1]} knots", f"give {at.shape[1]}, one for each place")
    inverse = np.full((len(at), at.shape[1] - 1), STEEP) if steps else 1.0 / np.diff(at, axis=1)
    place = at[:, 1:] if steps else at[:, :-1]
    rows = [values[:, 0]]
    for i in range(at.shape[1] - 1):
        rows += [place[:, i, None], inverse[:, i, None], values[:, i + 1] - values[:, i]]
    return np.concatenate(rows, axis=1)


def side_by_side(*parts: np.ndarray) -> np.ndarray:
    """Join arrays along the last dimension; a leading dimension of 1 is repeated."""
    return np.concatenate(repeated(*parts), axis=-1)


# 1 / distance of a jump between knots: steeper than any step resolves, and within float32.
STEEP = 1e20
# The part of a step by which a schedule jumps early: whatever the round-off, stages at the end of a step, which are earlier
# still, come before a jump there, and those at the beginning of the next step after it.
JUMP_EARLY = 2.0**-31


AnyTerm = TypeVar("AnyTerm", bound=Term)


def rows_of(value: Any) -> int:
    """Count the rows of a field before it is checked."""
    return len(np.atleast_1d(np.asarray(value, dtype=object)))


def build(where: str, kind: type[AnyTerm], table: Mapping[str, Any]) -> AnyTerm:
    """Build a term of one type from its table in a scene file."""
    if "file" in table and (reader := getattr(kind, "of_table", None)):
        return reader(where, table)
    faults = Faults()
    fields = {word_of(item): item for item in dataclasses.fields(kind) if item.init}
    values = {key: value for key, value in table.items() if key != "type"}
    faults.keys(where, values, fields)
    for name, item in fields.items():
        if item.default is dataclasses.MISSING and name not in values:
            faults.add(f"{where}.{name}", "", "is missing", f"give it [{item.metadata.get('unit', '')}]")
    faults.raise_if_any()
    try:
        return kind(**{fields[name].name: value for name, value in values.items()})
    except SceneError:
        raise
    except ValueError:  # a law that computes with its numbers before they are checked
        for name in (name for name in fields if name in values and ragged(values[name])):
            faults.add(f"{where}.{name}", values[name], "has rows of different lengths", "give rows of one length")
        faults.raise_if_any()
        raise


# The most terms, and the most events, of a scene: each adds code to the kernel.
MOST_TERMS = 1000


def check_list(key: str, entries: Any, example: str) -> list[Any]:
    """Read a list of terms or events; refuse a value that is not a list, or a list longer than a scene may have."""
    listed = items_of(entries)
    if listed is None:
        raise refusal(key, entries, "is not a list", example)
    if len(listed) > MOST_TERMS:
        raise SceneError([f"{key} are {len(listed):,}. Give at most {MOST_TERMS:,}"])
    return listed
