"""What every term is: checked numbers with units, any of which may vary by member, and how the kernel gets them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from lgvi_warp.common import names
from lgvi_warp.common.errors import Faults, SceneError, ragged
from lgvi_warp.physics.inertia import Frame

# Own numbers of a term, or all parameters of a scene, by name; leading dimension 1 (shared) or n (one per member).
Numbers = Mapping[str, np.ndarray]

# What a motion may conserve: energy [J], horizontal linear momentum [N s], vertical angular momentum [N m s].
CONSERVED = frozenset({"energy", "horizontal_momentum", "vertical_angular_momentum"})


@dataclass(frozen=True)
class Setting:
    """What a term may know when its numbers are made ready: all parameters of the scene, the frame, the run.

    parameters: "vehicle.mass" and so on; frame: axes and origin of the forces; members: indices (n,) of the members;
    seed: of the ensemble; h: the step [s]. aligned: whether the frame of every member of the run is the user's but for the
    order and sense of its axes.
    """

    parameters: Numbers
    frame: Frame
    members: np.ndarray
    seed: int
    h: float
    aligned: bool = False


class Packed(NamedTuple):
    """A term's numbers as its device code reads them.

    values: field of its Params -> (n,) numbers, (n, 3) vectors, whole numbers or (n,) whole numbers, in the kernel's axes;
    rows: (n, rows), its part of the table; memory: (n, rows), what it remembers at the start; work: how many rows it wants
    for numbers of the moment. n is 1 where all is shared.
    """

    values: dict[str, Any]
    rows: np.ndarray | None = None
    memory: np.ndarray | None = None
    work: int = 0


def quantity(
    shape: tuple[Any, ...], unit: str, default: Any = dataclasses.MISSING, least: float = -np.inf, most: float = np.inf
) -> Any:
    """A field of numbers. A name in the shape stands for any length, the same in all fields that use it."""
    meta = {"shape": shape, "unit": unit, "least": least, "most": most}
    if default is dataclasses.MISSING:
        return field(metadata=meta)
    return field(default=default, metadata=meta)


@dataclass(frozen=True, eq=False, kw_only=True)
class Term:
    """A law that a scene names. Its fields made by `quantity` are arrays after construction.

    type: the name in a scene file; device: its module in lgvi_kernels.terms, by name, or any object with the same
    functions; timed: whether the law looks at the time; dissipative: whether its
    damping never creates energy. name tells two terms of one type apart in "name.field".

    Raises SceneError naming every fault.
    """

    type: ClassVar[str] = ""
    # The types of a scene file; events have their own.
    kinds: ClassVar[dict[str, Any]] = {}
    # Whether it has a force: an event has none.
    acts: ClassVar[bool] = True
    device: ClassVar[Any] = ""
    timed: ClassVar[bool] = False
    dissipative: ClassVar[bool] = True

    name: str = ""

    def __post_init__(self) -> None:
        faults = Faults(f"{self.key}.")
        if not isinstance(self.name, str):
            faults.add("name", self.name, "is not a text", "give a name, or leave it out")
        elif self.key and (wrong := names.wrong_with(self.key)):
            faults.add("name" if self.name else "type", self.key, *wrong)
        lengths: dict[str, int] = {}
        for one in self.quantities():
            value = getattr(self, one.name)
            object.__setattr__(self, one.name, _checked(faults, one, value, lengths))
        if not faults:
            self.check(faults)
        faults.raise_if_any()

    @classmethod
    def quantities(cls) -> tuple[dataclasses.Field[Any], ...]:
        """The fields that hold numbers."""
        return tuple(one for one in dataclasses.fields(cls) if "shape" in one.metadata)

    @property
    def key(self) -> str:
        """What its parameters are called by: its name, or its type."""
        return self.name if isinstance(self.name, str) and self.name else self.type

    def check(self, faults: Faults) -> None:
        """Note what is wrong beyond shapes and bounds."""

    def parameters(self) -> dict[str, np.ndarray]:
        """Numbers that may vary by member, by field."""
        return {one.name: getattr(self, one.name) for one in self.quantities()}

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """Field -> (n,), which members' numbers are not finite or out of bounds."""
        bad = {}
        for one in self.quantities():
            value = own[one.name].reshape(len(own[one.name]), -1)
            low, high = one.metadata["least"], one.metadata["most"]
            with np.errstate(invalid="ignore"):
                bad[one.name] = ~np.all(np.isfinite(value) & (value >= low) & (value <= high), axis=1)
        return bad

    def present(self, own: Numbers) -> bool:
        """Whether any member feels it; by default always, since it was asked for."""
        return True

    @property
    def memory(self) -> bool:
        """Whether its device code remembers something from step to step."""
        return False

    @property
    def conserves(self) -> frozenset[str]:
        """What of `CONSERVED` a motion keeps where this law alone acts.

        By default energy, of a law whose device code is POTENTIAL and nothing else, if `potential` is defined and does not
        look at the time; else nothing. A law whose potential depends on depth and on the attitude to the vertical alone
        conserves all three: it overrides this.
        """
        device = self.device
        follows = getattr(device, "POTENTIAL", False) and type(self).potential is not Term.potential
        more = self.timed or self.memory or any(hasattr(device, role) for role in ("damping", "flow", "evolve"))
        return frozenset({"energy"} if follows and not more else ())

    def device_in(self, aligned: bool) -> Any:
        """Its device code, where the kernel's axes are the user's (see Setting) and where they are not."""
        return self.device

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """Its numbers in the kernel's axes."""
        raise NotImplementedError(f"{type(self).__name__} must define packed(own, setting): see docs/add_a_law.md")

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray | None:
        """Velocity of the water (k, n, 3) [m/s] at positions (k, n, 3) and times (k,) [s].

        None for laws that move none, or whose water is not known after the run.
        """
        return None

    def water_at_start(self, own: Numbers, position: np.ndarray, setting: Setting) -> np.ndarray:
        """Velocity of the water (n, 3) [m/s] where members start."""
        still = self.water(own, position[None], np.zeros(1), setting.parameters)
        return np.zeros_like(position) if still is None else still[0]

    def potential(
        self, own: Numbers, position: np.ndarray, attitude: np.ndarray, setting: Numbers
    ) -> np.ndarray | float:
        """Potential energy (k, n) [J] at positions (k, n, 3) and attitudes (k, n, 3, 3); 0 for laws without one."""
        return 0.0

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file."""
        content: dict[str, Any] = {"type": self.type} | ({"name": self.name} if self.name else {})
        for one in dataclasses.fields(self):
            value = getattr(self, one.name)
            if one.name != "name" and value is not None:
                content[one.name] = value.tolist() if isinstance(value, np.ndarray) else value
        return content


def _checked(faults: Faults, one: dataclasses.Field[Any], value: Any, lengths: dict[str, int]) -> np.ndarray | None:
    """The value of a field as an array of its shape, or None after noting a fault."""
    meta = one.metadata
    shape, unit = meta["shape"], meta["unit"]
    if any(isinstance(size, str) for size in shape):
        array = faults.finite(one.name, value, None, unit)
        if array is None:
            return None
        wanted = tuple(lengths.get(size, size) if isinstance(size, str) else size for size in shape)
        fits = array.ndim == len(shape) and all(
            isinstance(w, str) or w == g for w, g in zip(wanted, array.shape, strict=True)
        )
        if not fits or 0 in array.shape:
            text = " x ".join(str(size) for size in wanted)
            faults.add(one.name, value, f"has shape {array.shape}", f"give {text} numbers [{unit}]")
            return None
        lengths |= {size: got for size, got in zip(shape, array.shape, strict=True) if isinstance(size, str)}
    else:
        array = faults.finite(one.name, value, shape, unit)
    if array is not None and (np.any(array < meta["least"]) or np.any(array > meta["most"])):
        low, high = meta["least"], meta["most"]
        bounds = (
            f"from {low:g}" + (f" to {high:g}" if np.isfinite(high) else "") if np.isfinite(low) else f"to {high:g}"
        )
        faults.add(one.name, value, "is out of bounds", f"give numbers {bounds} [{unit}]")
        return None
    return array


def knots(at: np.ndarray, values: np.ndarray, steps: bool = False) -> np.ndarray:
    """Rows (n, ...) of a table on the device: first value, then for each knot after it its place, 1 / distance, change.

    at: (n, k), rising; values: (n, k, d). Linear between knots and constant outside; `steps`: each value holds from its
    knot to the next.
    """
    n = max(len(at), len(values))
    at, values = np.broadcast_to(at, (n, at.shape[1])), np.broadcast_to(values, (n, *values.shape[1:]))
    inverse = np.full((n, at.shape[1] - 1), STEEP) if steps else 1.0 / np.diff(at, axis=1)
    place = at[:, 1:] if steps else at[:, :-1]
    rows = [values[:, 0]]
    for i in range(at.shape[1] - 1):
        rows += [place[:, i, None], inverse[:, i, None], values[:, i + 1] - values[:, i]]
    return np.concatenate(rows, axis=1)


# 1 / distance of a jump: far beyond any step, and within float32.
STEEP = 1e20


AnyTerm = TypeVar("AnyTerm", bound=Term)


def build(where: str, kind: type[AnyTerm], table: Mapping[str, Any]) -> AnyTerm:
    """A term of this kind from its table in a scene file. Raises SceneError naming every fault."""
    faults = Faults()
    fields = {one.name: one for one in dataclasses.fields(kind) if one.init}
    given = {key: value for key, value in table.items() if key != "type"}
    faults.keys(where, given, fields)
    for name, one in fields.items():
        if one.default is dataclasses.MISSING and name not in given:
            faults.add(f"{where}.{name}", "", "is missing", f"give it [{one.metadata.get('unit', '')}]")
    faults.raise_if_any()
    try:
        return kind(**given)
    except SceneError:
        raise
    except ValueError:  # what a law makes of its numbers before they are checked
        for name in (name for name in fields if name in given and ragged(given[name])):
            faults.add(f"{where}.{name}", given[name], "has rows of different lengths", "give rows of one length")
        faults.raise_if_any()
        raise


# Of a scene, and so many events: each is code of the kernel.
MOST_TERMS = 1000


def few_enough(what: str, given: Sequence[Any]) -> None:
    """Refuse a list of more terms or events than any scene has. Raises SceneError."""
    if len(given) > MOST_TERMS:
        raise SceneError([f"{what}: are {len(given):,}; give at most {MOST_TERMS:,}"])
