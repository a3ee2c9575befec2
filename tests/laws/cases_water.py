# SPDX-License-Identifier: Apache-2.0
"""Cases of waves, currents that change, and noise. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp.physics import terms
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.terms.current import Current
from lgvi_warp.reference.terms.current_field import CurrentField
from lgvi_warp.reference.terms.gauss_markov_current import GaussMarkovCurrent
from lgvi_warp.reference.terms.waves import Waves
from lgvi_warp.reference.terms.wrench_noise import WrenchNoise
from tests.laws.case import Case, case

# The vehicle and gravity of tests/laws/test_parity.py.
GRAVITY = 9.8

HARMONICS = dict(
    amplitudes=((0.3, -0.2, 0.0), (0.1, 0.2, -0.1), (-0.05, 0.1, 0.02)),
    periods=(7.0, 3.1, 1.3),
    phases=(0.3, -1.2, 2.0),
)
WAVES = dict(
    amplitudes=(0.4, 0.3, 0.1), periods=(5.0, 3.5, 2.5), headings_deg=(20.0, -110.0, 200.0), phases=(0.5, -0.9, 2.5)
)
# The vehicle of tests/laws/test_parity.py is at 8 m.
SHALLOW = WAVES | {"depth": 11.0}
FLOW = dict(velocity=(0.3, -0.2, 0.1))
GAUSS_MARKOV = dict(standard_deviation=(0.3, 0.2, 0.05), time_constant=4.0)
WRENCH_NOISE = dict(force=(1.0, 2.0, 0.5), torque=(0.1, 0.2, 0.3))
# A quarter of the step of tests/laws/test_parity.py.
GRID = 0.005


def arrays(numbers):
    """Numbers as the twins take them."""
    return {key: np.asarray(value) for key, value in numbers.items()}


def waves(numbers, **beside):
    """A Case of waves, alone or on a uniform current."""
    currents = tuple(terms.Current(**beside) for _ in range(bool(beside)))
    laws = (Waves(**arrays({k: v for k, v in numbers.items() if k != "periods_of"}), gravity=GRAVITY),
            *(Current(**arrays(beside)) for _ in currents))  # fmt: skip
    laws[0].periods_of = numbers.get("periods_of", "ground")
    return Case((terms.Waves(**numbers), *currents), tuple(law.beside(laws) for law in laws))


def noisy(host, twin, numbers, name="", noise_step=None):
    """A Case whose twin draws the same random numbers."""
    term = host(**numbers, name=name, noise_step=noise_step)
    return Case((term,), (twin(**arrays(numbers), channel=channel(term.key), noise_step=noise_step),), False)


RNG = np.random.default_rng(8)
FIELD = dict(velocities=0.3 * RNG.normal(size=(2, 3, 5, 4, 3, 3)), origin=(-8.0, -6.0, 0.0), spacing=(4.0, 4.0, 8.0),
             times=(-0.2, 0.7), scenario=1.0)  # fmt: skip
STILL_FIELD = FIELD | {"velocities": 0.3 * RNG.normal(size=(5, 4, 1, 3)), "times": None, "scenario": 0.0}

CASES = {
    "current field": Case((terms.CurrentField(**FIELD),), (CurrentField(**arrays(FIELD)),), False),
    "current field that stays": Case(
        (terms.CurrentField(**STILL_FIELD),),
        (
            CurrentField(
                **arrays(STILL_FIELD | {"velocities": STILL_FIELD["velocities"][None, None], "times": (0.0, 1.0)})
            ),
        ),
        False,
    ),
    "current harmonics": case(terms.CurrentHarmonics, **HARMONICS),
    "waves": waves(WAVES),
    "waves in shallow water": waves(SHALLOW),
    "waves on a current": waves(SHALLOW, **FLOW),
    "waves that ride on a current": waves(WAVES | {"periods_of": "water"}, **FLOW),
    "Gauss-Markov current": noisy(terms.GaussMarkovCurrent, GaussMarkovCurrent, GAUSS_MARKOV),
    "wrench noise": noisy(terms.WrenchNoise, WrenchNoise, WRENCH_NOISE),
    "Gauss-Markov current on a grid": noisy(
        terms.GaussMarkovCurrent, GaussMarkovCurrent, GAUSS_MARKOV, noise_step=GRID
    ),
    "wrench noise on a grid": noisy(terms.WrenchNoise, WrenchNoise, WRENCH_NOISE, noise_step=GRID),
    "two wrench noises": Case(
        *(
            tuple(noisy(terms.WrenchNoise, WrenchNoise, WRENCH_NOISE, name)[side][0] for name in ("", "second"))
            for side in (0, 1)
        ),
        False,
    ),
}
