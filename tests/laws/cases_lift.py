# SPDX-License-Identifier: Apache-2.0
"""Fins, cross-flow drag and body lift beside their twins. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp.physics import terms
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.cross_flow import CrossFlow
from lgvi_warp.reference.terms.fins import Fins
from lgvi_warp.reference.terms.hull_loads import HullLoads
from lgvi_warp.reference.terms.lift import BodyLift
from lgvi_warp.reference.terms.quadratic_form import QuadraticForm
from lgvi_warp.reference.terms.waves import Waves
from tests.laws.case import Case

DENSITY = 1025.0


def arrays(numbers):
    return {key: np.array(value) for key, value in numbers.items()}


FINS = dict(
    position=((-0.6, 0.1, 0.0), (-0.6, 0.0, 0.1), (0.2, -0.2, 0.05)),
    chord=((1.0, 0.0, 0.0), (2.0, 0.1, 0.0), (0.9, 0.0, -0.3)),
    normal=((0.0, 0.0, -1.0), (0.2, 1.0, 0.1), (0.0, 0.5, -0.8)),
    area=(0.02, 0.03, 0.01),
    lift_slope=(3.0, 2.0, 4.0),
    drag=(0.02, 0.0, 0.05),
    drag_normal=(1.2, 0.5, 0.0),
)
# Commands beyond the limit, and faster than the rates where these are limited.
STEER = dict(limit=(0.35, 0.2, 0.5), times=(0.0, 0.4, 0.9, 1.5))
COMMANDS = ((0.1, 0.3, -0.2), (-0.3, 0.1, 0.6), (0.5, -0.3, 0.1), (0.0, 0.0, 0.0))
RATES = (0.4, 0.2, 1.0)
# Lift that falls at 0.3 rad and is gone across the flow.
STALL = dict(lift_angles=(0.0, 0.3, 0.4, 1.6), lift_coefficients=(0.0, 0.28, 0.2, 0.0))
HULL = dict(
    stations=(-0.7, -0.5, 0.0, 0.5, 0.8),
    diameters=(0.02, 0.15, 0.2, 0.2, 0.0),
    drag_coefficient=(1.0, 1.1, 1.2, 1.1, 0.9),
)
ADDED_MASS = (1.0, 12.0, 30.0, 28.0, 0.0)
STEEP_WAVES = dict(amplitudes=(0.5, 0.4), periods=(4.0, 5.0), headings_deg=(20.0, 150.0), phases=(0.5, -0.9))
# Products by name, and where they stand: kind, force, factor, velocity.
PRODUCTS = {
    "X_vr": (20.0, "c", 0, 1, 5),
    "X_u|u|": (-6.0, "d", 0, 0, 0),
    "Y_uv": (-15.0, "c", 1, 0, 1),
    "Y_|v|r": (-4.0, "d", 1, 1, 5),
    "Z_w|q|": (-3.0, "d", 2, 4, 2),
    "Z_w|vw|": (-30.0, "h", 2, 1, 2),
    "Z_uu": (2.0, "c", 2, 0, 0),
    "K_p|p|": (-1.5, "d", 3, 3, 3),
    "K_wr": (0.7, "c", 3, 2, 5),
    "M_uw": (4.0, "c", 4, 0, 2),
    "M_pr": (-0.8, "c", 4, 3, 5),
    "M_|vw|q": (-3.0, "h", 4, 1, 4),
    "N_r|r|": (-2.5, "d", 5, 5, 5),
    "N_uv": (-3.0, "c", 5, 0, 1),
}


def form():
    """Products of all kinds beside dense tables of the same values."""
    twin = {"c": np.zeros((6, 6, 6)), "d": np.zeros((6, 6, 6)), "h": np.zeros((6, 6))}
    for value, kind, i, j, k in PRODUCTS.values():
        twin[kind][(i, k) if kind == "h" else (i, j, k)] = value
    return Case(
        (terms.QuadraticForm(products=tuple(PRODUCTS), values=[entry[0] for entry in PRODUCTS.values()]),),
        (QuadraticForm(**twin),),
    )


LIFT = np.random.default_rng(5).normal(size=(6, 6)) * np.array([4.0, 4.0, 4.0, 0.5, 0.5, 0.5])


def steered(rates, **more):
    """Control fins with a schedule; rates: (3,) [rad/s], or None; more: further numbers."""
    host = more if rates is None else {"rate_limit": rates, **more}
    twin = ControlFins(
        **arrays(FINS | STEER | more),
        density=DENSITY,
        rate_limit=np.full(3, np.inf) if rates is None else np.array(rates),
        command=np.array(COMMANDS),
    )
    return Case((terms.ControlFins(**FINS, **STEER, **host, command_schedule=COMMANDS),), (twin,), False)


CASES = {
    "fins": Case((terms.Fins(**FINS),), (Fins(**arrays(FINS), density=DENSITY),)),
    "control fins": steered(None),
    "control fins with rates": steered(RATES),
    "control fins that lag": steered(RATES, time_constant=(0.1, 0.0, 0.3), **STALL),
    "cross-flow": Case((terms.CrossFlow(**HULL),), (CrossFlow(**arrays(HULL), density=DENSITY),)),
    "hull loads": Case(
        (terms.HullLoads(**HULL, added_mass=ADDED_MASS), terms.Waves(**STEEP_WAVES, name="swell")),
        (
            HullLoads(**arrays(HULL), added_mass=np.array(ADDED_MASS), density=DENSITY),
            Waves(**arrays(STEEP_WAVES), gravity=9.8),
        ),
    ),
    "quadratic form": form(),
    "body lift": Case((terms.BodyLift(matrix=LIFT),), (BodyLift(matrix=LIFT),)),
}
