# SPDX-License-Identifier: Apache-2.0
"""Each term of a scene beside its twin: what the parity, order and bits tests of tests/laws/test_parity.py run over.

Those of an extension are in tests/extensions/NAME/cases.py.
"""

from importlib import import_module
from pathlib import Path

import numpy as np

from lgvi_warp.physics import terms
from lgvi_warp.reference.terms.thrusters import Thrusters
from lgvi_warp.reference.terms.wrench import WrenchSchedule
from tests.laws import cases_lift, cases_water
from tests.laws.case import Case, case, matrix

LINEAR, QUADRATIC = (3.0, 4.0, 5.0, 0.3, 0.4, 0.5), (10.0, 30.0, 40.0, 1.0, 2.0, 3.0)
TABLE = dict(
    times=(0.0, 0.3, 0.7, 1.5),
    force=((0.0, 0.0, 0.0), (5.0, -2.0, 1.0), (-3.0, 4.0, 2.0), (1.0, 1.0, 1.0)),
    torque=((0.0, 0.1, 0.0), (0.2, -0.2, 0.1), (-0.3, 0.1, 0.2), (0.0, 0.0, 0.1)),
)
TWIN_TABLE = {key: np.array(value) for key, value in TABLE.items()}
THRUSTERS = dict(
    position=((-0.5, 0.2, 0.0), (-0.5, -0.2, 0.0), (0.1, 0.0, 0.3)),
    direction=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.8)),
    dead_band=(0.1, 0.1, 0.05),
    limit=(0.9, 0.8, 1.0),
    time_constant=(0.2, 0.1, 0.3),
)
COMMANDS = dict(times=(0.0, 0.5, 1.5), command_schedule=((0.3, 0.8, -0.7), (0.7, -0.9, 0.9), (0.5, 0.5, -1.5)))
# A rate that some commands exceed, and others do not.
PROPELLERS = dict(
    rate_limit=(0.8, 2.0, 1.5),
    advance_loss=(3.0, 2.0, 0.0),
    advance_loss_astern=(1.0, 0.0, 2.0),
    torque_coefficient=(0.5, -0.4, 0.2),
    torque_loss=(0.1, -0.05, 0.0),
)
TABLE_OF_THRUST = (
    (-0.8, -0.3, -0.1, 0.1, 0.4, 1.0),
    ((-9.0, -8.0, -5.0), (-2.0, -3.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5.0, 3.0, 4.0), (20.0, 12.0, 9.0)),
)

CASES = {
    "linear drag": case(terms.Drag, linear=LINEAR, quadratic=(0.0,) * 6),
    "quadratic drag": case(terms.Drag, linear=(0.0,) * 6, quadratic=QUADRATIC),
    "drag": case(terms.Drag, linear=LINEAR, quadratic=QUADRATIC),
    "drag matrix": case(terms.DragMatrix, linear=matrix(1, 3.0), quadratic=0.1 * matrix(2) + np.diag(QUADRATIC)),
    "current": case(terms.Current, velocity=(0.3, -0.2, 0.1)),
    "current profile": case(
        terms.CurrentProfile,
        depths=(-100.0, 100.0),
        velocities=((-30.0, 20.0, -10.0), (30.0, -20.0, 10.0)),
    ),
    "tether": case(
        terms.Tether, anchor=(1.0, 2.0, 3.0), stiffness=5.0, attachment=(0.5, -0.1, 0.2), rest_length=2.0
    ),
    "slack tether": case(
        terms.Tether, anchor=(0.0, 0.0, 10.0), stiffness=5.0, attachment=(0.1, 0.0, 0.0), rest_length=50.0
    ),
    "wrench": case(terms.Wrench, force=(1.0, -2.0, 0.5), torque=(0.1, 0.2, -0.3)),
    "energy use": case(terms.EnergyUse, hotel=7.0),
    "wrench schedule": Case((terms.WrenchSchedule(**TABLE),), (WrenchSchedule(**TWIN_TABLE),), False),
    "wrench in steps": Case(
        (terms.WrenchSchedule(**TABLE, interpolation="steps"),),
        (WrenchSchedule(**TWIN_TABLE, steps=True),),
        False,
    ),
    "thrusters": Case(
        (terms.Thrusters(**THRUSTERS, **COMMANDS, coefficient=(20.0, 20.0, 10.0), coefficient_astern=(15.0, 15.0, 8.0)),),
        (
            Thrusters(
                **{k: np.array(v) for k, v in THRUSTERS.items()},
                forward=np.array((20.0, 20.0, 10.0)),
                backward=np.array((15.0, 15.0, 8.0)),
                times=np.array(COMMANDS["times"]),
                command=np.array(COMMANDS["command_schedule"]),
            ),
        ),
        False,
    ),
    "thrusters with polynomials": Case(
        (
            terms.Thrusters(
                **THRUSTERS, **COMMANDS, coefficient=(2.0, 3.0, 1.0), coefficient_astern=(1.5, 2.5, 0.5),
                polynomial=(3.0, 0.5, 8.0, -2.0, 1.0), polynomial_astern=(2.0, 7.0, -1.5),
            ),
        ),
        (
            Thrusters(
                **{k: np.array(v) for k, v in THRUSTERS.items()},
                forward=np.array((2.0, 3.0, 1.0)),
                backward=np.array((1.5, 2.5, 0.5)),
                times=np.array(COMMANDS["times"]),
                command=np.array(COMMANDS["command_schedule"]),
                polynomial=(3.0, 0.5, 8.0, -2.0, 1.0),
                polynomial_astern=(2.0, 7.0, -1.5),
            ),
        ),
        False,
    ),
    "thrusters with a table": Case(
        (
            terms.Thrusters(
                **THRUSTERS, **COMMANDS, **PROPELLERS, coefficient=(2.0, 3.0, 1.0), coefficient_astern=(1.5, 2.5, 0.5),
                table_commands=TABLE_OF_THRUST[0], table_thrusts=TABLE_OF_THRUST[1],
            ),
        ),
        (
            Thrusters(
                **{k: np.array(v) for k, v in (THRUSTERS | PROPELLERS).items()},
                forward=np.array((2.0, 3.0, 1.0)),
                backward=np.array((1.5, 2.5, 0.5)),
                times=np.array(COMMANDS["times"]),
                command=np.array(COMMANDS["command_schedule"]),
                table_commands=np.array(TABLE_OF_THRUST[0]),
                table_thrusts=np.array(TABLE_OF_THRUST[1]),
            ),
        ),
        False,
    ),
}  # fmt: skip

CASES |= cases_water.CASES | cases_lift.CASES
# Of extensions: numbers by type with which nothing of a term jumps (test_parity.py); further cases (test_device_code.py).
HELD, ALONE = {}, {}
for path in sorted((Path(__file__).parents[1] / "extensions").glob("*/cases.py")):
    cases = import_module(f"tests.extensions.{path.parent.name}.cases")
    CASES |= cases.CASES
    HELD |= cases.HELD
    ALONE |= cases.ALONE


def together(*names):
    """A Case with the laws of several."""
    cases = [CASES[name] for name in names]
    laws = sum((case.laws for case in cases), ())
    return Case(
        sum((case.terms for case in cases), ()),
        tuple(law.beside(laws) for law in laws),
        all(case.smooth for case in cases),
    )


# One of each type.
ALL = (
    "drag matrix", "current", "current field", "current profile", "current harmonics", "waves", "Gauss-Markov current",
    "energy use", "tether", "wrench", "wrench schedule", "wrench noise", "moving mass", "thrusters", "fins",
    "control fins with rates", "cross-flow", "hull loads", "body lift", "stratification", "ballast with pumps",
    "buoyancy engine", "polar", "surface buoyancy", "quadratic form", "sea state",
)  # fmt: skip
CASES["all together"] = together(*(name for name in ALL if name in CASES))
