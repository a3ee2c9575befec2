# SPDX-License-Identifier: Apache-2.0
"""Linear waves: the base class of all seas, and waves with given components."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import refusal
from lgvi_warp.physics.terms.base import Array, Numbers, Packed, PackingContext, Term, number, own
from lgvi_warp.physics.terms.current_harmonics import Harmonics
from lgvi_warp.physics.terms.surface_level import rise_above

# Decay to the floor, e^(-k h), of deep water: its square is 0 in float32.
DEEP = 1e-30
# Steps of Newton's method for the wavenumber. From the deep-water value it never passes the root, and each step squares the
# error: in 2 m to 2 km of water, on currents from -1 to 3 m/s, eight are enough for rounding.
STEPS = 12
# Part of the frequency by which a wavenumber may miss it: where it does, no wave of this frequency travels here.
MISS = 1e-9


class Components(NamedTuple):
    """Components of a sea, (n, k) each; the first ones are the rows of lgvi_kernels/laws/waves.py.

    north, east, k: Components and size of the wavenumber [1/m]. omega: Frequency at a fixed point [rad/s]. phase: [rad].
    ahead, aside: North and east components of the heading. speed: a sigma / (1 - decay^2) [m/s], where a is the amplitude and
    sigma the frequency in the water. decay: e^(-k h), where h is the depth of the sea; 0 in deep water. amplitude: Of the
    surface [m]; 0 for a blocked wave. blocked: Mask of waves that cannot travel against an opposing current.
    """

    north: Array
    east: Array
    k: Array
    omega: Array
    phase: Array
    ahead: Array
    aside: Array
    speed: Array
    decay: Array
    amplitude: Array
    blocked: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class WaveTerm(Term):
    """Base class of linear waves, a sum of components. Abstract.

    Args:
        depth: Depth of the sea [m], above 0; inf for deep water.
        periods_of: Frame of the periods in a uniform current: "ground", the default, a fixed point; or "water", a point that
            drifts with the current. In the other frame the periods have a Doppler shift.

    Attributes:
        period: Period of the highest wave [s]; None if there are no waves.
        periods_field: Name of the field that holds periods.

    Methods:
        sea: Amplitudes, frequencies, headings and phases of the components.
        wave_table: The components with their wavenumbers.
        elevation: Height of the surface above still water.
        steepness: Steepness of the waves.
    """

    timed: ClassVar[bool] = True
    # The fields that hold periods and heights; the steepness from which on waves break, and what a check then says.
    periods_field: ClassVar[str] = ""
    height_field: ClassVar[str] = ""
    breaks: ClassVar[float] = 0.0
    too_steep: ClassVar[str] = ""
    usual: ClassVar[Mapping[str, Any]] = {"depth": "seas have any depth"}
    # Uniform currents, and the flat floor whose depth is the sea's; set for a term of a scene.
    currents: ClassVar[tuple[Term, ...]] = ()
    floor: ClassVar[Any] = None
    looks_at_surface: ClassVar[bool] = True

    depth: Any = number((), "m", None, above=0.0, optional=True, infinite=True)
    periods_of: str = word("ground", known=("ground", "water"))

    def known_of(self, terms: Sequence[Term]) -> dict[str, Any]:
        """{attribute: terms} of the other terms of the scene that the waves depend on."""
        return {"currents": tuple(other for other in terms if other.carries)}

    def beside(self, terms: Sequence[Term]) -> Any:
        # Knows the uniform currents, which shift frequencies.
        others = self.known_of(terms)
        if all(getattr(self, name) == value for name, value in others.items()):
            return self
        term = copy.copy(self)
        vars(term).update(others)
        return term

    @property
    def period(self) -> float | None:
        """Period of the highest wave [s]; None if there are no waves."""
        raise NotImplementedError

    def sea(self, numbers: Numbers) -> tuple[Array, Array, Array, Array]:
        """Amplitudes [m], frequencies in the frame of `periods_of` [rad/s], headings and phases [rad] of the components.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            Four arrays (n, k).
        """
        raise NotImplementedError

    def steepness(self, numbers: Numbers, parameters: Numbers) -> Array:
        """Steepness of the waves, to be compared with `breaks`.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            parameters: All parameters of the scene, by name.

        Returns:
            Steepness (n,).
        """
        raise NotImplementedError

    @property
    def finite(self) -> bool:
        """Whether the sea has a finite depth."""
        return self.floor is not None or (self.depth is not None and bool(np.isfinite(self.depth)))

    def wave_table(self, numbers: Numbers, parameters: Numbers) -> Components:
        """The components with their wavenumbers.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            parameters: All parameters of the scene, by name.

        Returns:
            The components, arrays of shape (n, k).
        """
        amplitude, omega, heading, phase = self.sea(numbers)
        g = parameters["environment.gravity"][:, None]
        along, across = np.cos(heading), np.sin(heading)
        u = self._current(parameters)
        drift = 0.0 if u is None else along * u[:, :1] + across * u[:, 1:2]
        h = self._depth(numbers, parameters)
        k = wavenumbers(omega, 0.0 if self.periods_of == "water" else drift, h, g)
        shift = np.where(np.isnan(k), 0.0, k * drift)
        omega, sigma = (omega + shift, omega) if self.periods_of == "water" else (omega, omega - shift)
        blocked = np.isnan(k)
        k, amplitude = np.where(blocked, 0.0, k), np.where(blocked, 0.0, amplitude)
        decay = np.maximum(np.exp(-k * h), DEEP) if self.finite else np.zeros_like(k)
        speed = amplitude * sigma / (1.0 - np.where(blocked, 0.0, decay) ** 2)
        rows = (k * along, k * across, k, omega, phase, along, across, speed, decay, amplitude, blocked)
        return Components(*np.broadcast_arrays(*rows))

    def _current(self, parameters: Numbers) -> Array | None:
        """Total velocity (n, 3) [m/s] of the uniform currents; None if there are none."""
        flows = []
        for term in self.currents:
            numbers = own(term, parameters)
            here = np.zeros((1, max(map(len, numbers.values()), default=1), 3))
            flows.append(term.water(numbers, here, np.zeros(1), parameters))
        known = [flow[0] for flow in flows if flow is not None]
        return np.asarray(sum(known[1:], known[0])) if known else None

    def _depth(self, numbers: Numbers, parameters: Numbers) -> Any:
        """Depth of the sea (n, 1) [m]."""
        if not self.finite:
            return np.inf
        depth = parameters[f"{self.floor.key}.depth"] if self.floor is not None else numbers["depth"]
        if self.floor is not None and self.surface_level is not None:
            depth = depth + self.surface_level.mean_height(own(self.surface_level, parameters))
        return depth[:, None]

    def device_in(self, aligned: bool) -> str:
        return "waves_finite" if self.finite else "waves"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Device rows of each component; raises SceneError where there is no gravity, hence no wavenumber.
        g = context.parameters["environment.gravity"]
        if np.any(g <= 0.0):
            fault = f"leaves the length of {self.key} unknown (wavenumber = omega^2 / gravity)"
            remedy = f"give gravity above 0, or leave {self.key} out"
            raise refusal("environment.gravity", float(g.min()), fault, remedy)
        shallowest = np.min(self._depth(numbers, context.parameters))
        if shallowest <= 0.0:
            over = context.parameters[f"{self.floor.key}.depth"]
            fault = (
                f"leaves no water for {self.key}: {-float(shallowest):.4g} m of the floor lie above the mean surface"
            )
            raise refusal(
                f"{self.floor.key}.depth", float(np.min(over)), fault, f"give a deeper floor, or {self.key} a depth"
            )
        c = self.wave_table(numbers, context.parameters)
        columns = c[: 8 + self.finite]
        rows = np.stack(columns, axis=-1)
        return Packed({"count": rows.shape[1]}, rows.reshape(len(rows), -1))

    def water(self, numbers: Numbers, position: Array, time: Array, parameters: Numbers) -> Array:
        # Orbital velocity (k, n, 3) [m/s] at positions and times; above the surface as there, below the floor as there.
        total = np.zeros(position.shape)
        x, y, depth = np.moveaxis(position, -1, 0)
        depth = depth + rise_above(self, time, parameters)
        for j in range((components := self.wave_table(numbers, parameters)).k.shape[1]):
            north, east, k, omega, phase, ahead, aside, speed, f, *_ = (table[:, j] for table in components)
            theta = north * x + east * y + (phase - omega * time[:, None])
            e = np.exp(-k * np.maximum(depth, 0.0))
            e, z = (np.maximum(e, f), f**2 / np.maximum(e, f)) if self.finite else (e, 0.0)
            cosine, sine = speed * (e + z) * np.cos(theta), speed * (e - z) * np.sin(theta)
            total = total + np.stack([cosine * ahead, cosine * aside, -sine], axis=-1)
        return total

    def elevation(self, numbers: Numbers, position: Array, time: Array, parameters: Numbers) -> Array:
        """Height of the surface above still water.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            position: Positions (k, n, 3) [m] in inertial axes; their depths are not used.
            time: Times (k,) [s].
            parameters: All parameters of the scene, by name.

        Returns:
            Heights (k, n) [m].
        """
        total = np.zeros(position.shape[:-1])
        x, y, _ = np.moveaxis(position, -1, 0)
        c = self.wave_table(numbers, parameters)
        for north, east, omega, phase, amplitude in zip(
            *(table.T for table in (c.north, c.east, c.omega, c.phase, c.amplitude)), strict=True
        ):
            total = total + amplitude * np.cos(north * x + east * y + (phase - omega * time[:, None]))
        return total


@dataclass(frozen=True, eq=False, kw_only=True)
class Waves(WaveTerm, Harmonics):
    """Linear waves of angular frequency sqrt(g K tanh(K depth)) relative to the water; g: gravity, K: wavenumber.

    Args:
        amplitudes: Amplitudes of the surface, (k,) [m].
        periods: Periods, (k,) [s], above 0.
        phases: Phases at t = 0 at the inertial origin, (k,) [rad]; 0 by default.
        headings_deg: Directions in which the waves travel, (k,) [deg] from north.
        depth: Depth of the sea [m], above 0; by default the water is deep.
        periods_of: Frame in which the periods hold in a uniform current: "ground", the default, for a fixed point; or "water",
            for a point that drifts with the current.

    Raises:
        SceneError: If a period is not above 0, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "waves"
    periods_field: ClassVar[str] = "periods"
    height_field: ClassVar[str] = "amplitudes"
    # Stokes 1880, in deep water; Miche 1944: times tanh(k depth).
    breaks: ClassVar[float] = 0.44
    too_steep: ClassVar[str] = (
        "a steepness k a of {:.3g} is beyond {:g}, at which waves break: a period or an amplitude?"
    )

    amplitudes: Any = number(("k",), "m", least=0.0)
    headings_deg: Any = number(("k",), "deg")

    @property
    def period(self) -> float | None:
        if not np.any(self.amplitudes):
            return None
        return float(np.ravel(self.periods)[np.argmax(np.ravel(self.amplitudes))])

    def sea(self, numbers: Numbers) -> tuple[Array, Array, Array, Array]:
        omega = 2.0 * np.pi / numbers["periods"]
        return numbers["amplitudes"], omega, np.radians(numbers["headings_deg"]), numbers["phases"]

    def steepness(self, numbers: Numbers, parameters: Numbers) -> Array:
        # Of many components the root of the sum of their squares. Those of one period and heading are one wave, whose
        # amplitude is the sum of theirs with their phases.
        c = self.wave_table(numbers, parameters)
        slopes, square = c.k * c.amplitude * np.exp(1j * c.phase), np.zeros(1)
        slopes = slopes / np.tanh(np.where(c.k > 0.0, c.k, 1.0) * self._depth(numbers, parameters))
        for j in range(slopes.shape[1]):
            turned = np.cos(np.radians(numbers["headings_deg"] - numbers["headings_deg"][:, j : j + 1]))
            same = (numbers["periods"] == numbers["periods"][:, j : j + 1]) & (turned > 1.0 - 1e-12)
            square = square + (slopes[:, j] * np.conj((same * slopes).sum(axis=1))).real
        return np.sqrt(np.maximum(square, 0.0))


def waves_of(terms: Sequence[Term]) -> tuple[WaveTerm, ...]:
    """The waves among the terms and events of a scene, with access to the others."""
    return tuple(term.beside(terms) for term in terms if isinstance(term, WaveTerm))


def water_of(waves: Sequence[WaveTerm]) -> str:
    """Feature of the device code for some waves: "finite" if any of them is in finite depth, else "waves"."""
    return "finite" if any(term.finite for term in waves) else "waves"


def pressure_rows(waves: Sequence[WaveTerm], parameters: Numbers) -> tuple[list[Array], int]:
    """Rows (n, rows) of each wave term for device code that reads surface and pressure, and the count of components."""
    rows, count, finite = [], 0, water_of(waves) == "finite"
    for term in waves:
        c = term.wave_table(own(term, parameters), parameters)
        columns = (*c[:5], c.amplitude / (1.0 + c.decay**2), np.maximum(c.decay, DEEP))
        rows.append(np.stack(columns[: 6 + finite], axis=-1).reshape(len(c.k), -1))
        count += c.k.shape[1]
    return rows, count


def wavenumbers(omega: Array, drift: Any, depth: Any, gravity: Array) -> Array:
    """Wavenumbers k [1/m] with sqrt(g k tanh(k h)) + k U = omega (Peregrine 1976); NaN for waves that a current blocks.

    omega: [rad/s], (n, k). drift: U, the current along each wave [m/s]. depth: h [m]; inf for deep water. gravity: [m/s2].
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        # In deep water sigma + U sigma^2 / g = omega.
        sigma = 2.0 * omega / (1.0 + np.sqrt(1.0 + 4.0 * drift * omega / gravity))
        k = sigma**2 / gravity
        if np.all(np.isinf(depth)):
            return np.asarray(k)
        for _ in range(STEPS):
            held = np.tanh(k * depth)
            sigma = np.sqrt(gravity * k * held)
            # Group velocity.
            slope = 0.5 * gravity * (held + k * depth * (1.0 - held**2)) / sigma + drift
            k = np.where(np.isinf(depth), k, k - (sigma + k * drift - omega) / slope)
        missed = np.abs(np.sqrt(gravity * k * np.tanh(k * depth)) + k * drift - omega) > MISS * omega
        return np.where(missed, np.nan, k)
