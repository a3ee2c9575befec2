# SPDX-License-Identifier: Apache-2.0
"""Ballast, buoyancy engines and polars beside their twins. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp.extensions.gliders.twin.ballast import Ballast
from lgvi_warp.extensions.gliders.twin.buoyancy_engine import BuoyancyEngine
from lgvi_warp.physics import terms
from tests.laws.case import Case, case

# The environment of tests/laws/test_parity.py.
WATER = dict(density=1025.0, gravity=9.8)
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


HELD = Ballast(
    position=np.array(TANKS), times=np.zeros(1), command=np.array(((2e-4, -3e-4),)), limit=np.full(2, 1e6),
    potential_force=True, **WATER,
)  # fmt: skip

# The vehicle of tests/laws/test_parity.py starts at 8 m and comes to 8.2 m within half a second, and then to 8.25 m.
ENGINE = dict(pump_rate=2e-3, volume_down=-1e-3, volume_up=2e-3, depth_top=6.0, depth_bottom=8.1, position=(0.3, 0.02, 0.1),
              volume_start=-2e-4, gradient=0.02, reference_depth=3.0)  # fmt: skip

# Of a glider (see lgvi_warp/vehicles/seawing.toml), a tenth of it: the vehicle of tests/laws/test_parity.py turns fast.
POLAR = dict(drag=0.7, drag_by_attack=38.0, side_by_slip=-12.0, lift=-0.04, lift_by_attack=44.0, roll_by_slip=-5.8, pitch=0.03,
             pitch_by_attack=-6.6, yaw_by_slip=3.4, moment_by_rate=(-2.0, -20.0, -39.0))  # fmt: skip

# Of a volume that is held the schedule does not act, and so may not vary: see tests/laws/test_device_code.py.
HELD_BALLAST = Case((terms.Ballast(position=TANKS, command=(2e-4, -3e-4)),), (HELD,))

CASES = {
    "polar": case(terms.Polar, **POLAR),
    "ballast in time": scheduled(),
    "ballast with pumps": scheduled(**PUMPS),
    "buoyancy engine": Case(
        (terms.BuoyancyEngine(**ENGINE),),
        (BuoyancyEngine(**{key: np.asarray(value) for key, value in ENGINE.items()}, **WATER),),
        False,
    ),
}
