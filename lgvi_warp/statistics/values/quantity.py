# SPDX-License-Identifier: Apache-2.0
"""Quantities of each member at each sample time: named quantities, or functions of the samples."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import closest, refusal
from lgvi_warp.common.real_numbers import NotReal, real_results, settle
from lgvi_warp.common.sentences import sentences
from lgvi_warp.control.base import ControlLaw, Guidance, MeasuringPart
from lgvi_warp.control.signals import CHANNELS, SIGNALS, ordered
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS, TABLE, Field
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.terms.floor import altitude_over
from lgvi_warp.physics.vehicle import UNITS

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

Function = Callable[["Fields", "Members"], np.ndarray]


@dataclass(frozen=True)
class Quantity:
    """Custom quantity: a function of the samples of a block, for k sample times and n members.

    If the number of a member is not finite at a time, statistics leave out the member at this time.

    Args:
        name: name in results and messages.
        function: function(samples, members) that returns numbers (k, n), or (k, n, d) for d components.
            samples["position"] is (k, n, 3) and so on, samples.time is (k,) [s], samples.terms and samples.events are
            the scene's; members are as returned by lw.Ensemble.select.
        unit: unit of the numbers; by default "".
        fields: names of the samples that the function reads; by default all.
        labels: names of the d components; by default `name`, for one component.
        needs_limit: True if a condition on the quantity needs a limit. By default False: the function may return true
            or false.
        entries: (field, indices from 0) for each field of which the function reads only some components; at a
            controller's ticks the other components are NaN. By default none: the function reads whole fields.
    """

    name: str
    function: Function
    unit: str = ""
    fields: tuple[str, ...] = FIELDS
    labels: tuple[str, ...] = ()
    needs_limit: bool = False
    entries: tuple[tuple[str, tuple[int, ...]], ...] = ()

    def __post_init__(self) -> None:
        settle(self, "fields")
        labels = listed("labels", () if self.labels is None else self.labels, "texts")
        object.__setattr__(self, "labels", tuple(labels))
        if not labels:
            object.__setattr__(self, "labels", (self.name,))

    @property
    def size(self) -> int:
        """The number d of components."""
        return len(self.labels)

    def __call__(self, samples: Fields, members: Members) -> np.ndarray:
        """Evaluate the quantity.

        Returns: (k, d, n), contiguous; float32 if the function returns float32, else float64.
        """
        try:
            values = real_results(self.function(samples, members))
        except NotReal as error:
            raise ValueError(
                sentences(f"quantity {self.name}", error.what, "return real numbers, true or false")
            ) from None
        k, n = len(samples.time), members.count
        if values.shape not in ((k, n), (k, n, self.size)) or (values.ndim == 2 and self.size != 1):
            wanted = f"({k}, {n})" if self.size == 1 else f"({k}, {n}, {self.size})"
            raise ValueError(f"quantity {self.name} gave shape {values.shape}. It must be {wanted}: times, members")
        real = np.float32 if values.dtype == np.float32 else np.float64
        return np.ascontiguousarray(values.reshape(k, n, self.size).transpose(0, 2, 1), dtype=real)


def _field(name: str) -> Function:
    return lambda samples, members: samples[name].reshape(*samples[name].shape[:2], -1)


def _speed(samples: Fields, members: Members) -> np.ndarray:
    v = samples["velocity"].astype(np.float64, copy=False)
    return np.sqrt(v[..., 0] ** 2 + v[..., 1] ** 2 + v[..., 2] ** 2)


def _velocity_inertial(samples: Fields, members: Members) -> np.ndarray:
    R, v = samples["attitude"], samples["velocity"].astype(np.float64, copy=False)
    return R[..., 0] * v[..., :1] + R[..., 1] * v[..., 1:2] + R[..., 2] * v[..., 2:]


def _quaternion_wxyz(samples: Fields, members: Members) -> np.ndarray:
    return notation.quaternion_from_matrix(samples["attitude"].astype(np.float64, copy=False))


def _euler(samples: Fields, members: Members) -> np.ndarray:
    """Euler angles (roll, pitch, yaw) of R = Rz(yaw) Ry(pitch) Rx(roll), Fossen's zyx convention."""
    R = samples["attitude"].astype(np.float64, copy=False)
    pitch = -np.arcsin(np.clip(R[..., 2, 0], -1.0, 1.0))
    return np.stack([np.arctan2(R[..., 2, 1], R[..., 2, 2]), pitch, np.arctan2(R[..., 1, 0], R[..., 0, 0])], axis=-1)


def _altitude(samples: Fields, members: Members) -> np.ndarray:
    """Height above the highest floor of the scene, as `Result.altitude`."""
    return altitude_over(samples.events, samples["position"], members.parameters)


def _energy(samples: Fields, members: Members) -> np.ndarray:
    """Mechanical energy [J], as `Result.energy`."""
    terms: Sequence[Term] = samples.terms

    def own(term: Term) -> dict[str, np.ndarray]:
        return {name: members.parameters[f"{term.key}.{name}"] for name in term.parameters()}

    fields = {name: samples[name] for name in FIELDS}
    block: Any = SimpleNamespace(**fields, time=samples.time, parameters=members.parameters, terms=terms, own=own)
    return invariants.energy(block)


def _known(name: str, fields: tuple[str, ...], function: Function) -> Quantity:
    return _of(TABLE[name], fields, function)


def _of(field: Field, fields: tuple[str, ...], function: Function) -> Quantity:
    return Quantity(field.name, function, field.unit, fields, field.labels, needs_limit=True)


KNOWN: dict[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        _known("position", ("position",), _field("position")),
        _known("depth", ("position",), lambda samples, members: samples["position"][..., 2]),
        _known("altitude", ("position",), _altitude),
        _known("velocity", ("velocity",), _field("velocity")),
        _known("velocity_inertial", ("attitude", "velocity"), _velocity_inertial),
        _known("speed", ("velocity",), _speed),
        _known("angular_velocity", ("angular_velocity",), _field("angular_velocity")),
        _known("attitude", ("attitude",), _field("attitude")),
        _known("quaternion_wxyz", ("attitude",), _quaternion_wxyz),
        _known("euler", ("attitude",), _euler),
        _known("energy", FIELDS, _energy),
    )
}


@functools.cache
def _of_signal(name: str) -> Quantity | None:
    """A controller's signal whose shape is the same in all scenes; None if it is no such signal."""
    known = name not in CHANNELS and name in SIGNALS
    return _of(SIGNALS[name].field, (name,), _field(name)) if known else None


def named(key: str, of: str, text: str) -> Quantity:
    """Return the quantity of a name, or one component of it."""
    match = re.fullmatch(r"(\w+)(\[[\d, ]+\])?", text.strip())
    if match and match[1] in CHANNELS:
        return _channel(key, of, match[1], match[2] or "")
    if match is None or (base := KNOWN.get(match[1]) or _of_signal(match[1])) is None:
        raise refusal(key, of, "is not known", closest(text, (*KNOWN, *SIGNALS)))
    if match[2] is None:
        return base
    label = f"{base.name}[{', '.join(match[2][1:-1].replace(' ', '').split(','))}]"
    if label not in base.labels:
        if base.size == 1:
            raise refusal(key, of, f"{base.name} has one component", f"give {base.name!r}")
        raise refusal(key, of, f"{base.name} has the components {', '.join(base.labels)}", "give one of them")
    return component(base, base.labels.index(label))


def _channel(key: str, of: str, name: str, index: str) -> Quantity:
    """One channel of the actuators; their number is known only from the scene."""
    if not re.fullmatch(r"\[\d+\]", index):
        raise refusal(key, of, f"is not one channel of {name}", f"give one: '{name}[0]'")
    i, label = int(index[1:-1]), name + index

    def function(samples: Fields, members: Members) -> np.ndarray:
        count = samples[name].shape[-1]
        if i >= count:
            remedy = f"give '{name}[0]' to '{name}[{count - 1}]'"
            raise refusal(key, of, f"is beyond the {count} channels of this scene", remedy)
        return samples[name][..., i]

    return Quantity(label, function, SIGNALS[name].field.unit, (name,), needs_limit=True)


def of_number(key: str, of: str, text: str) -> Quantity:
    """One number of each member, constant in time; which numbers exist is known only from the scene."""
    match = re.fullmatch(r"(.+?)(\[[\d,]+\])?", text)
    assert match is not None
    name, index = match[1], match[2] or ""
    place = tuple(int(i) for i in index[1:-1].split(",") if i)
    entry: Any = (..., *place)
    if "[" in name:
        raise refusal(key, of, "names a part by its place", "name it by its own name, as in 'heading_pid.kp'")

    def function(samples: Fields, members: Members) -> np.ndarray:
        starts = getattr(members, "starts", {})
        if name not in (*members.parameters, *starts):
            if name.startswith("start."):
                raise refusal(key, of, "does not vary", "vary it, or give a quantity at the start, as in 'depth at 0'")
            raise refusal(key, of, "is not a number of this scene", closest(name, (*members.parameters, *starts)))
        values = members.parameters[name] if name in members.parameters else starts[name]
        shape = values.shape[1:]
        if len(place) != len(shape) or any(i >= most for i, most in zip(place, shape, strict=True)):
            first, last = (",".join(str(i) for i in corner) for corner in ([0] * len(shape), [n - 1 for n in shape]))
            remedy = f"give '{name}[{first}]' to '{name}[{last}]'" if shape else f"give {name!r}"
            raise refusal(key, of, f"is not a single number: {name} has shape {shape}", remedy)
        return np.broadcast_to(values[entry], (len(samples.time), members.count))

    return Quantity(name + index, function, unit_of_number(name), ("position",), needs_limit=True)


def unit_of_number(name: str) -> str:
    """The unit of a number of the vehicle, the start, or a term or part without its own name; "" if it is unknown."""
    owner, _, word = name.rpartition(".")
    if owner == "start" and word in TABLE:
        return TABLE[word].unit
    sections = {"vehicle": UNITS, "environment": {"gravity": "m/s2", "water_density": "kg/m3"}}
    found = sections.get(owner, {}).get(word, "")
    for kinds in (Term.kinds, MeasuringPart.kinds, Guidance.kinds, ControlLaw.kinds) if owner not in sections else ():
        if owner in kinds:
            found = next((item.metadata["unit"] for item in kinds[owner].number_fields() if item.name == word), found)
    return "" if found == "unit" or "," in found else found


def component(base: Quantity, i: int) -> Quantity:
    """Return one component of a quantity as a quantity."""
    if base.size == 1:
        return base
    inner = base.function
    return replace(base, name=base.labels[i], labels=(base.labels[i],), function=lambda s, m: inner(s, m)[..., i])


def joined(parts: Sequence[Quantity]) -> Quantity:
    """Return several quantities as one, with concatenated components."""
    if len(parts) == 1:
        return parts[0]

    def function(samples: Fields, members: Members) -> np.ndarray:
        return np.concatenate([part(samples, members) for part in parts], axis=1).transpose(0, 2, 1)

    fields = ordered(name for part in parts for name in part.fields)
    units: Mapping[str, None] = dict.fromkeys(part.unit for part in parts)
    labels = tuple(label for part in parts for label in part.labels)
    needs_limit = any(part.needs_limit for part in parts)
    return Quantity(", ".join(part.name for part in parts), function, ", ".join(units), fields, labels, needs_limit)
