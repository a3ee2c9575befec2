# SPDX-License-Identifier: Apache-2.0
"""A random sea from a forecast."""

import functools
import math

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms.waves import Waves, halved

CUT, INTERVALS = 3.0, 1024
# Of Gauss, for what is smooth.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(100)


class SeaState(Waves):
    """Numbers of `lw.terms.SeaState`; gravity [m/s2]."""

    spectrum, amplitudes_are, peakedness, spreading = "jonswap", "equal", 3.3, None

    def enhanced(self, x: float) -> float:
        """Ratio of JONSWAP to Pierson-Moskowitz at x, frequency divided by peak frequency (Hasselmann et al. 1973)."""
        if self.spectrum != "jonswap":
            return 1.0
        return float(self.peakedness ** math.exp(-((x - 1.0) ** 2) / (2.0 * (0.07 if x <= 1.0 else 0.09) ** 2)))

    def ratios(self) -> Array:
        """Frequencies x divided by the peak's, from the energy below x; exp(-5/4 x^-4) in a fully developed sea."""
        most, parts = math.exp(-1.25 * CUT**-4), [0.0]
        for i in range(INTERVALS):
            parts.append(parts[-1] + self.enhanced(_ratio(most * (i + 0.5) / INTERVALS)))
        found = []
        for j, level in enumerate(self.levels[:, 0]):
            wanted = (j + level) / len(self.levels) * parts[-1]
            i = min(int(np.searchsorted(parts, wanted, side="right")) - 1, INTERVALS - 1)
            rest = (wanted - parts[i]) / (parts[i + 1] - parts[i])
            found.append(_ratio(most * (i + rest) / INTERVALS))
        return np.array(found)

    @functools.cached_property
    def periods(self) -> Array:
        """Periods of the waves [s]."""
        return self.peak_period / self.ratios()

    @property
    def phases(self) -> Array:
        """Phases of the waves [rad]."""
        return 2.0 * math.pi * self.levels[:, 1]

    @functools.cached_property
    def headings_deg(self) -> Array:
        """Headings of the waves [deg]: the level is the integral of cos^2s of half the angle from the mean."""
        if self.spreading is None:
            return np.full(len(self.levels), self.heading_deg)
        total = self.below(0.5 * math.pi)
        half = [
            halved(lambda x, u=u: self.below(x) - u * total, -0.5 * math.pi, 0.5 * math.pi) for u in self.levels[:, 2]
        ]
        return np.asarray(self.heading_deg + 2.0 * np.degrees(half))

    def below(self, x: float) -> float:
        """Integral of cos^2s from -pi / 2 to x."""
        middle, reach = 0.5 * (x - 0.5 * math.pi), 0.5 * (x + 0.5 * math.pi)
        return float(reach * WEIGHTS @ np.cos(middle + reach * NODES) ** (2.0 * (self.spreading or 0.0)))

    @property
    def amplitudes(self) -> Array:
        """Amplitudes of the waves [m]; their squares add up to Hs^2 / 8."""
        count = len(self.levels)
        equal = np.full(count, self.significant_height / math.sqrt(8.0 * count))
        return equal * np.sqrt(-np.log(self.levels[:, -1])) if self.amplitudes_are == "rayleigh" else equal


def _ratio(part: float) -> float:
    return float((1.25 / -math.log(part)) ** 0.25)
