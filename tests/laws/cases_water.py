# SPDX-License-Identifier: Apache-2.0
"""Cases of waves, currents that change, noise and stratification. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp.physics import terms
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.terms.current_field import CurrentField
from lgvi_warp.reference.terms.gauss_markov_current import GaussMarkovCurrent
from lgvi_warp.reference.terms.stratification import Stratification
from lgvi_warp.reference.terms.surface_buoyancy import SurfaceBuoyancy
from lgvi_warp.reference.terms.waves import Waves
from lgvi_warp.reference.terms.wrench_noise import WrenchNoise
from tests.laws.case import Case, case

# The vehicle and gravity of tests/laws/test_parity.py.
GRAVITY, BUOYANCY, CENTER_OF_BUOYANCY = 9.8, 21.5 * 9.8, np.array((0.01, 0.005, -0.02))

HARMONICS = dict(
    amplitudes=((0.3, -0.2, 0.0), (0.1, 0.2, -0.1), (-0.05, 0.1, 0.02)),
    periods=(7.0, 3.1, 1.3),
    phases=(0.3, -1.2, 2.0),
)
WAVES = dict(
    amplitudes=(0.4, 0.3, 0.1), periods=(5.0, 3.5, 2.5), headings_deg=(20.0, -110.0, 200.0), phases=(0.5, -0.9, 2.5)
)
GAUSS_MARKOV = dict(standard_deviation=(0.3, 0.2, 0.05), time_constant=4.0)
WRENCH_NOISE = dict(force=(1.0, 2.0, 0.5), torque=(0.1, 0.2, 0.3))
# A quarter of the step of tests/laws/test_parity.py.
GRID = 0.005
STRATIFICATION = dict(gradient=0.05, reference_depth=6.0)
# So high that some of it is above the surface. Its pitch then grows too fast for an order to be seen, unlike that of one part.
SURFACE = dict(heights=(20.0, 24.0, 26.0, 18.0), stations=(-2.0, -0.5, 1.5, 2.0))
BALL = dict(heights=(24.0,), stations=(0.0,))


def arrays(numbers):
    """Numbers as the twins take them."""
    return {key: np.asarray(value) for key, value in numbers.items()}


def noisy(host, twin, numbers, name="", noise_step=None):
    """A Case whose twin draws the same random numbers."""
    term = host(**numbers, name=name, noise_step=noise_step)
    return Case((term,), (twin(**arrays(numbers), channel=channel(term.key), noise_step=noise_step),), False)


def surface(numbers, section, *waves):
    """A Case of buoyancy that fades at the surface, below waves if a term and its twin are given."""
    hull = SurfaceBuoyancy(**arrays(numbers), section=section, buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY)
    term = terms.SurfaceBuoyancy(**numbers, section=section)
    return Case((term, *waves[:1]), (hull.beside(waves[1:]), *waves[1:]), numbers is BALL)


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
    "waves": Case((terms.Waves(**WAVES),), (Waves(**arrays(WAVES), gravity=GRAVITY),)),
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
    "surface buoyancy": surface(SURFACE, "circle"),
    "surface buoyancy of a box": surface(SURFACE, "box"),
    "surface buoyancy of a ball": surface(BALL, "circle"),
    "surface buoyancy in waves": surface(BALL, "box", terms.Waves(**WAVES), Waves(**arrays(WAVES), gravity=GRAVITY)),
    "stratification": Case(
        (terms.Stratification(**STRATIFICATION),),
        (Stratification(**STRATIFICATION, buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY),),
    ),
    "stratification of a hull that yields": Case(
        (terms.Stratification(**STRATIFICATION, compressibility=0.02),),
        (
            Stratification(
                **STRATIFICATION, compressibility=0.02, buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY
            ),
        ),
    ),
}
