# SPDX-License-Identifier: Apache-2.0
"""Terms of gliders beside their twins. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp import terms
from lgvi_warp.extensions.gliders.twin.ballast import Ballast
from lgvi_warp.extensions.gliders.twin.buoyancy_engine import BuoyancyEngine
from lgvi_warp.extensions.gliders.twin.moving_mass import MovingMass
from lgvi_warp.extensions.gliders.twin.stratification import Stratification
from lgvi_warp.extensions.gliders.twin.surface_buoyancy import SurfaceBuoyancy
from lgvi_warp.reference.terms.waves import Waves
from tests.laws.case import Case, case
from tests.laws.cases_water import GRAVITY, SHALLOW, WAVES, arrays

# The environment of tests/laws/test_parity.py.
WATER = dict(density=1025.0, gravity=9.8)
BUOYANCY, CENTER_OF_BUOYANCY = 21.5 * 9.8, np.array((0.01, 0.005, -0.02))
TANKS = ((0.4, 0.0, 0.1), (-0.5, 0.02, 0.0))
VOLUMES = dict(times=(0.0, 0.4, 0.9, 1.5), command_schedule=((2e-4, -3e-4), (-4e-4, 2e-4), (6e-4, -1e-4), (0.0, 0.0)))
# Reached by one volume, and faster than the rate of the other.
PUMPS = dict(limit=(5e-4, 4e-4), rate_limit=(1.5e-3, 4e-4), time_constant=(0.2, 0.0))


def scheduled(**motion):
    """Two tanks along a schedule."""
    twin = {key: np.array(value) for key, value in ({"limit": (1e6, 1e6)} | motion).items()}
    times, commands = (np.array(VOLUMES[name]) for name in ("times", "command_schedule"))
    return Case(
        (terms.Ballast(position=TANKS, **VOLUMES, **motion),),
        (Ballast(position=np.array(TANKS), times=times, command=commands, **WATER, **twin),),
        False,
    )


HELD_TWIN = Ballast(
    position=np.array(TANKS), times=np.zeros(1), command=np.array(((2e-4, -3e-4),)), limit=np.full(2, 1e6),
    potential_force=True, **WATER,
)  # fmt: skip

# The vehicle of tests/laws/test_parity.py starts at 8 m and comes to 8.2 m within half a second, and then to 8.25 m.
ENGINE = dict(pump_rate=2e-3, volume_down=-1e-3, volume_up=2e-3, depth_top=6.0, depth_bottom=8.1, position=(0.3, 0.02, 0.1),
              volume_start=-2e-4, gradient=0.02, reference_depth=3.0)  # fmt: skip

# Of a glider (see the vehicle seawing), a tenth of it: the vehicle of tests/laws/test_parity.py turns fast.
POLAR = dict(drag=0.7, drag_by_attack=38.0, side_by_slip=-12.0, lift=-0.04, lift_by_attack=44.0, roll_by_slip=-5.8, pitch=0.03,
             pitch_by_attack=-6.6, yaw_by_slip=3.4, moment_by_rate=(-2.0, -20.0, -39.0))  # fmt: skip

STRATIFICATION = dict(gradient=0.05, reference_depth=6.0)
# So high that some of it is above the surface. Its pitch then grows too fast for an order to be seen, unlike that of one part.
SURFACE = dict(heights=(20.0, 24.0, 26.0, 18.0), stations=(-2.0, -0.5, 1.5, 2.0))
BALL = dict(heights=(24.0,), stations=(0.0,))

# A battery that goes forward and aside, and back.
SLIDING = dict(
    mass=6.0, times=(0.1, 0.45, 1.2), places=((0.05, 0.0, 0.06), (0.25, -0.1, 0.06), (-0.1, 0.05, 0.1)),
    reference=(0.0, 0.02, 0.05), inertia=False,
)  # fmt: skip


def surface(numbers, section, *waves):
    """A Case of buoyancy that fades at the surface, below waves if a term and its twin are given."""
    hull = SurfaceBuoyancy(**arrays(numbers), section=section, buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY)
    term = terms.SurfaceBuoyancy(**numbers, section=section)
    return Case((term, *waves[:1]), (hull.beside(waves[1:]), *waves[1:]), numbers is BALL)


# Of a volume that is held the schedule does not act, and so may not vary: see tests/laws/test_device_code.py.
ALONE = {"held ballast": Case((terms.Ballast(position=TANKS, command=(2e-4, -3e-4)),), (HELD_TWIN,))}
HELD = {"surface_buoyancy": BALL}

CASES = {
    "polar": case(terms.Polar, **POLAR),
    "ballast in time": scheduled(),
    "ballast with pumps": scheduled(**PUMPS),
    "buoyancy engine": Case(
        (terms.BuoyancyEngine(**ENGINE),),
        (BuoyancyEngine(**{key: np.asarray(value) for key, value in ENGINE.items()}, **WATER),),
        False,
    ),
    "moving mass": Case(
        (terms.MovingMass(**SLIDING),),
        (MovingMass(**{key: np.asarray(value) for key, value in SLIDING.items()}, gravity=9.8),),
        False,
    ),
    "surface buoyancy": surface(SURFACE, "circle"),
    "surface buoyancy of a box": surface(SURFACE, "box"),
    "surface buoyancy of a ball": surface(BALL, "circle"),
    "surface buoyancy in waves": surface(BALL, "box", terms.Waves(**WAVES), Waves(**arrays(WAVES), gravity=GRAVITY)),
    "surface buoyancy in shallow waves": surface(
        BALL, "circle", terms.Waves(**SHALLOW), Waves(**arrays(SHALLOW), gravity=GRAVITY)
    ),
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
