# SPDX-License-Identifier: Apache-2.0
"""A random sea from a forecast: JONSWAP or Pierson-Moskowitz spectrum, with directional spreading."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import whole, word
from lgvi_warp.common.random import uniforms
from lgvi_warp.physics.terms.base import Array, Numbers, Term, number
from lgvi_warp.physics.terms.floor import Floor
from lgvi_warp.physics.terms.waves import WaveTerm

# Frequency over that of the peak beyond which the spectrum is cut: 1.5 % of a Pierson-Moskowitz sea lies there. Its slopes
# would grow without bound.
CUT = 3.0
# Exponent of the spectrum below its peak, exp(-5/4 (fp / f)^4), and breadths of the peak below and above it.
FALL, BREADTHS = 1.25, (0.07, 0.09)
# Intervals of the table of a peaked spectrum's energy.
INTERVALS = 1024
# Part of a fully grown sea's energy that lies below the cut.
GROWN = float(np.exp(-FALL * CUT**-4.0))
# Hs / (g Tp^2 / 2 pi) from which on there is no such sea: a wave that breaks has the height 1/7 of its length.
STEEPEST = 1.0 / 7.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SeaState(WaveTerm):
    """A random sea with a significant height and a peak period, as a sum of linear waves of equal energy (Goda 2010).

    Every member has its own sea. The frequency of each wave is drawn within its share of the spectrum, so that the surface
    does not repeat in time. Phases are drawn, too, and headings if the sea has a `spreading`.

    Args:
        significant_height: Significant wave height Hs [m], 4 times the standard deviation of the surface.
        peak_period: Period Tp of the spectrum's peak [s].
        heading_deg: Mean direction in which the waves travel [deg] from north. Forecasts give the direction from which the
            waves come: add 180.
        spectrum: "jonswap", the default (Hasselmann et al. 1973), for young seas; or "pierson_moskowitz", for fully developed
            seas.
        peakedness: Peak enhancement factor of a JONSWAP spectrum, at least 1; 3.3 by default.
        spreading: Exponent s of the directional distribution, cos^2s of half the angle from the mean (Longuet-Higgins et al.
            1963). Its standard deviation is sqrt(2 / (s + 1)) rad. By default all waves have the mean direction.
        amplitudes: "equal", the default, for exactly Hs in every member; or "rayleigh", for random amplitudes as in a section
            of a long record.
        components: Number of waves; 20 by default.
        depth: Depth of the sea [m]; by default the depth of the scene's flat floor. Without such a floor the water is deep.
        periods_of: Frame of the periods in a uniform current: "ground", the default, as measured by a moored buoy; or
            "water", as measured by a buoy that drifts with the current.
        seed: Seed, a whole number from 0, of a sea that all members share. By default (None), each member has its own
            sea, drawn with the seed of the ensemble.
        levels: Uniform random numbers in (0, 1) that determine the frequency, the phase and, if these are random, the heading
            and amplitude of each wave, (components, 2 to 4); by default they are drawn.

    Methods:
        density: The spectrum of the surface.

    Raises:
        SceneError: If a number is out of bounds or otherwise invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> sea = lw.terms.SeaState(significant_height=1.2, peak_period=6.5, heading_deg=250.0, spreading=8.0)
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100", terms=[sea], start={"position": [0.0, 0.0, 10.0]}), 100)
        >>> fleet.parameters(0, 100)["sea_state.levels"].shape
        (100, 20, 3)
    """

    type: ClassVar[str] = "sea_state"
    strengths: ClassVar[tuple[str, ...]] = ("significant_height",)
    periods_field: ClassVar[str] = "peak_period"
    height_field: ClassVar[str] = "significant_height"
    breaks: ClassVar[float] = STEEPEST
    too_steep: ClassVar[str] = (
        "a steepness Hs / (g Tp^2 / 2 pi) of {:.3g} is beyond {:.3g}, at which waves break: a height or a period?"
    )
    usual: ClassVar[Mapping[str, Any]] = {
        **WaveTerm.usual,
        "significant_height": (20.0, "no higher sea was ever measured: is it in feet, or a crest in mm?"),
        "peakedness": (10.0, "the most peaked seas have 7"),
        "spreading": (1000.0, "swell has 75 or less; is it an angle?"),
        "levels": "levels between 0 and 1",
    }

    significant_height: Any = number((), "m", least=0.0)
    peak_period: Any = number((), "s", above=0.0)
    heading_deg: Any = number((), "deg")
    peakedness: Any = number((), "1", 3.3, least=1.0)
    spreading: Any = number((), "1", None, least=0.0, optional=True)
    levels: Any = number(("components", "draws"), "1", None, least=0.0, most=1.0, optional=True)
    spectrum: str = word("jonswap", known=("jonswap", "pierson_moskowitz"))
    amplitudes: str = word("equal", known=("equal", "rayleigh"))
    components: int = whole(1, "is no number of waves", "give 1 or more", default=20)
    seed: int | None = whole(0, "is no seed", "give a whole number from 0, or leave it out", default=None)

    @property
    def _shape(self) -> tuple[int, int]:
        """Shape of the levels."""
        return self.components, 2 + (self.spreading is not None) + (self.amplitudes == "rayleigh")

    def shape_of(self, item: Field[Any]) -> tuple[Any, ...]:
        return self._shape if item.name == "levels" else super().shape_of(item)

    def known_of(self, terms: Sequence[Term]) -> dict[str, Any]:
        # Knows the floor, too, where it is flat.
        flat = [other for other in terms if isinstance(other, Floor) and not other.on_grid]
        return super().known_of(terms) | {"floor": flat[0] if flat and self.depth is None else None}

    @property
    def unused(self) -> tuple[str, ...]:
        # A fully grown sea has no peak of its own.
        return ("peakedness",) * (self.spectrum != "jonswap")

    @property
    def drawn(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("levels",) if self.levels is None and self.seed is None else ()

    @functools.cached_property
    def _levels(self) -> Array:
        """The given levels, or those drawn with the seed; without a seed, those of seed 0."""
        if self.levels is not None:
            return np.asarray(self.levels)
        return uniforms(self.seed or 0, self.type, 0, 1, int(np.prod(self._shape))).reshape(self._shape)

    def parameters(self) -> dict[str, Array]:
        return super().parameters() | {"levels": self._levels}

    @property
    def period(self) -> float | None:
        return float(self.peak_period) if self.significant_height > 0.0 else None

    def sea(self, numbers: Numbers) -> tuple[Array, Array, Array, Array]:
        levels, count = numbers["levels"], self.components
        ratio = self._ratios((np.arange(count) + levels[..., 0]) / count, numbers)
        heading = np.radians(numbers["heading_deg"])[:, None] + np.zeros(count)
        if self.spreading is not None:
            from scipy.special import betaincinv

            # The sine of half the angle, from -1 to 1, has the density (1 - x^2)^(s - 1/2).
            s = numbers["spreading"][:, None] + 0.5
            heading = heading + 2.0 * np.arcsin(2.0 * betaincinv(s, s, levels[..., 2]) - 1.0)
        amplitude = numbers["significant_height"][:, None] / np.full(count, np.sqrt(8.0 * count))
        if self.amplitudes == "rayleigh":
            amplitude = amplitude * np.sqrt(-np.log(np.maximum(levels[..., -1], 1e-300)))
        omega = 2.0 * np.pi / numbers["peak_period"][:, None] * ratio
        return amplitude, omega, heading, 2.0 * np.pi * levels[..., 1]

    def _ratios(self, levels: Array, numbers: Numbers) -> Array:
        """Frequencies divided by the peak frequency (n, k), below which the fractions `levels` (n, k) of the energy lie."""
        if "peakedness" not in numbers:
            return _ratio(levels * GROWN)
        edges = np.linspace(0.0, GROWN, INTERVALS + 1)
        energy = np.cumsum(_enhanced(_ratio(_middles()), numbers["peakedness"][:, None]), axis=1)
        below = np.concatenate([np.zeros((len(energy), 1)), energy / energy[:, -1:]], axis=1)
        if len(below) == 1:
            return _ratio(np.interp(levels, below[0], edges))
        levels = np.broadcast_to(levels, (len(below), levels.shape[1]))
        return np.stack([_ratio(np.interp(*each, edges)) for each in zip(levels, below, strict=True)])

    def steepness(self, numbers: Numbers, parameters: Numbers) -> Array:
        length = parameters["environment.gravity"] * numbers["peak_period"] ** 2 / (2.0 * np.pi)
        return np.asarray(numbers["significant_height"] / length)

    def density(self, frequency: Any) -> Array:
        """Spectral density of the surface elevation, from the term's own numbers.

        Args:
            frequency: Frequencies of any shape [Hz], above 0.

        Returns:
            Densities [m^2/Hz] of the same shape; their integral over frequency is Hs^2 / 16.

        Examples:
            >>> import lgvi_warp as lw
            >>> sea = lw.terms.SeaState(significant_height=2.0, peak_period=8.0, heading_deg=0.0)
            >>> sea.density([0.1, 0.125, 0.15]).round(2)
            array([0.98, 6.26, 1.61])
        """
        x = np.asarray(frequency, dtype=np.float64) * self.peak_period
        gamma = self.peakedness if self.spectrum == "jonswap" else np.ones(())
        energy = GROWN * _enhanced(_ratio(_middles()), gamma).mean()
        slope = 4.0 * FALL * x**-5.0 * np.exp(-FALL * x**-4.0) * self.peak_period
        return np.where(x <= CUT, self.significant_height**2 / 16.0 * _enhanced(x, gamma) * slope / energy, 0.0)


def _ratio(part: Array) -> Array:
    """Frequency divided by the peak frequency, below which a fraction of the energy of a fully developed sea lies."""
    with np.errstate(divide="ignore"):
        return np.asarray((FALL / -np.log(part)) ** 0.25)


def _middles() -> Array:
    """Midpoints of the intervals of this fraction."""
    return (np.arange(INTERVALS) + 0.5) * (GROWN / INTERVALS)


def _enhanced(ratio: Array, peakedness: Any) -> Array:
    """Factor of a JONSWAP spectrum relative to that of a fully developed sea."""
    breadth = np.where(ratio > 1.0, *BREADTHS[::-1])
    return np.asarray(peakedness ** np.exp(-0.5 * ((ratio - 1.0) / breadth) ** 2))
