# SPDX-License-Identifier: Apache-2.0
"""The vehicles that others have modelled: their files against the sources' conventions, and closed forms of their motion."""

import numpy as np
import pytest
from scipy.optimize import brentq

import lgvi_warp as lw
from lgvi_warp.vehicles.fossen import vehicle_tables
from tests.support.steady_motion import Body, down_of, fins, push

NAMES = ("lauv", "rexrov", "eca_a9", "girona_500", "dsrv")


def term(name, kind):
    (found,) = [t for t in vehicle_tables(name)["terms"] if t["type"] == kind]
    return found


def test_the_rexrov_s_thrusters_give_the_printed_allocation():
    """uuv_thruster_manager/config/rexrov/TAM.yaml, x ahead, y to port, z up; printed to about 1e-6."""
    printed = np.array([
        [0.15974268848446743, 0.15974268848446743, -0.1597424266785477, -0.1597424266785477,
         0.7071068613706476, 0.7071068613706476, -0.7071065406341925, -0.7071065406341925],
        [-0.2136101154609486, 0.2136101154609486, -0.21360976537047976, 0.21360976537047976,
         0.7071067010024383, -0.7071067010024383, 0.7071070217388206, -0.7071070217388206],
        [0.9637701967007046, 0.9637701967007046, 0.9637703176884092, 0.9637703176884092, 0.0, 0.0, 0.0, 0.0],
        [0.4352320257020549, -0.4352320257020549, 0.43523188102298654, -0.43523188102298654,
         -0.09121676442931455, 0.09121676442931455, -0.09121680580430785, 0.09121680580430785],
        [0.9430934973994073, 0.9430934973994073, -0.9430934667380183, -0.9430934667380183,
         0.09121678511681354, 0.09121678511681354, -0.09121674374181084, -0.09121674374181084],
        [0.13688862492470316, -0.13688862492470316, -0.1368884005748274, 0.1368884005748274,
         -0.6487987634902757, 0.6487987634902757, 0.6487987335687417, -0.6487987335687417],
    ])  # fmt: skip
    t = term("rexrov", "thrusters")
    own = np.array([push(at, np.array(along)) for at, along in zip(t["position"], t["direction"], strict=True)]).T
    np.testing.assert_allclose(np.array([1, -1, -1, 1, -1, -1])[:, None] * own, printed, atol=1e-6)


def test_the_girona_s_thrusters_give_the_printed_allocation():
    """dynamics_g500.yaml's, with setpoints of surge turned: there a negative one pushes ahead."""
    c, dh, dv = 6.835e-5 * 1500.0**2, 0.4, 0.35
    printed = c * np.array([
        [-1, -1, 0, 0, 0], [0, 0, 0, 0, 1], [0, 0, -1, -1, 0], [0, 0, 0, 0, 0], [0, 0, -dv, dv, 0], [-dh, dh, 0, 0, 0],
    ])  # fmt: skip
    t = term("girona_500", "thrusters")
    rows = zip(t["position"], t["direction"], t["coefficient"], strict=True)
    own = np.array([push(at, f * np.array(along)) for at, along, f in rows]).T
    np.testing.assert_allclose(own * [-1, -1, 1, 1, 1], printed, atol=1e-12)


@pytest.mark.parametrize(("commands", "sign"), [
    ((1, -1, -1, 1), {5: 1, 1: -1}), ((1, 1, -1, -1), {4: -1, 2: -1}), ((-1, -1, -1, -1), {3: 1}),
])  # fmt: skip
def test_the_a9_s_fins_do_what_their_file_says(commands, sign):
    """Bow to starboard, stern up, roll to starboard; and hardly anything else."""
    t = term("eca_a9", "control_fins") | {"command": (0.05 * np.array(commands)).tolist()}
    total = fins(t, np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 1027.0)
    one = 0.5 * 1027.0 * 0.04155 * 13.98 * 0.05 * 2.0**2
    for i in range(1, 6):
        assert np.sign(np.round(total[i] / one, 2)) == sign.get(i, 0), i


def test_the_dsrv_has_the_printed_coefficients():
    """By the importer of standard coefficients: what it makes of the printed ones less what the added mass makes."""
    vehicle = vehicle_tables("dsrv")["vehicle"]
    A, rigid = np.array(vehicle["added_mass_matrix"]), np.array(vehicle["rigid_body_mass_matrix"])
    printed = {"Z'w": -0.043938, "Z'q": -0.017455, "M'w": 0.011175, "M'q": -0.01131}
    printed |= {"Y'v": -0.043938, "Y'r": 0.017455, "N'v": -0.011175, "N'r": -0.01131}
    form = lw.terms.QuadraticForm.gertler_hagen(printed, rho=1025.0, length=5.0, added_mass=A)
    made = dict(zip(form.products, form.values.tolist(), strict=True))
    own = term("dsrv", "quadratic_form")
    for name, value in list(zip(own["products"], own["values"], strict=True))[1:]:
        assert value == pytest.approx(made[name], rel=1e-12), name
    half = 0.5 * 1025.0 * 5.0**3
    assert rigid[0, 0] == pytest.approx(0.036391 * half, rel=1e-12)
    assert rigid[4, 4] == pytest.approx(0.001925 * half * 25.0, rel=1e-12)
    assert A[2, 2] == pytest.approx(0.031545 * half, rel=1e-12)
    assert A[4, 4] == pytest.approx(0.001573 * half * 25.0, rel=1e-12)
    assert A[2, 4] == pytest.approx(0.5 * (0.000130 + 0.000146) * half * 5.0, rel=1e-12)
    # M_theta of a small pitch, and the stern planes' force and moment.
    body = Body(vehicle_tables("dsrv"), {"wrench": {"force": [0.0] * 3}})
    assert body.forces(np.zeros(6), down_of(0.0, 1e-6))[4] / 1e-6 == pytest.approx(-0.156276 * half, rel=1e-9)
    planes = fins(term("dsrv", "control_fins") | {"command": [0.0, 0.1]}, np.array([3.0, 0, 0, 0, 0, 0]), 1025.0)
    assert planes[2] == pytest.approx(-0.027695 * half / 5.0 * 9.0 * 0.1, rel=1e-12)
    assert planes[4] == pytest.approx(-0.012797 * half * 9.0 * 0.1, rel=1e-12)


def test_the_dsrv_s_derived_numbers_follow_from_their_formulas():
    vehicle, m, L = vehicle_tables("dsrv")["vehicle"], 0.036391 * 0.5 * 1025.0 * 125.0, 5.0
    b = np.sqrt(m / 1025.0 / (4.0 / 3.0 * np.pi * L / 2.0))
    e = np.sqrt(1.0 - (2.0 * b / L) ** 2)
    # Lamb's k1 by its integral: alpha = a b^2 int ds / ((a^2 + s)^(3/2) (b^2 + s)), s = b^2 (1/t^2 - 1)
    from scipy.integrate import quad

    def inside(t):
        s = b * b * (1.0 / t**2 - 1.0)
        return 2.0 * b * b / t**3 / ((L * L / 4.0 + s) ** 1.5 * (b * b + s))

    alpha = L / 2.0 * b * b * quad(inside, 0.0, 1.0, epsrel=1e-12)[0]
    assert vehicle["added_mass_matrix"][0][0] == pytest.approx(m * alpha / (2.0 - alpha), rel=1e-9)
    assert vehicle["rigid_body_mass_matrix"][3][3] == pytest.approx(0.4 * m * b * b, rel=1e-12)
    surface = 2.0 * np.pi * b * b * (1.0 + L / 2.0 / (b * e) * np.arcsin(e))
    friction = 0.075 / (np.log10(4.11 * L / 1.188e-6) - 2.0) ** 2
    slender = 1.0 + 1.5 * (2.0 * b / L) ** 1.5 + 7.0 * (2.0 * b / L) ** 3
    drag = 0.5 * 1025.0 * surface * friction * slender
    assert -term("dsrv", "quadratic_form")["values"][0] == pytest.approx(drag, rel=1e-12)
    assert term("dsrv", "wrench")["force"][0] == pytest.approx(drag * 4.11**2, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_each_rights_itself(name):
    """At rest any small roll or pitch is pushed back, by buoyancy times its lever."""
    body = Body(vehicle_tables(name), {"wrench": {"force": [0.0] * 3}}, neutral=True)
    lever = body.gravity_at[2] - body.buoyancy_at[2]
    assert lever > 0.0
    for axis, angles in ((3, (1e-4, 0.0)), (4, (0.0, 1e-4))):
        assert body.forces(np.zeros(6), down_of(*angles))[axis] == pytest.approx(-body.weight * lever * 1e-4, rel=1e-7)


@pytest.mark.parametrize(("name", "commands", "balance"), [
    ("lauv", {"thrusters": {"command": [200.0]}}, lambda u: 0.0002 * 200.0**2 - 2.4 * u - 2.4 * u * u),
    ("eca_a9", {"thrusters": {"command": [800.0]}}, lambda u: 0.000049 * 800.0**2 - 8.0 * u * u),
    ("girona_500", {"thrusters": {"command": [0.5, 0.5, 0.0, 0.0, 0.0]}}, lambda u: 0.5 * 153.7875 - 148.0 * u * u),
    ("dsrv", {}, lambda u: 322.0846433879751 - 19.067175980960034 * u * u),
])  # fmt: skip
def test_a_neutral_one_runs_straight_where_thrust_is_drag(name, commands, balance):
    speed = brentq(balance, 0.0, 20.0, xtol=1e-13)
    steady = Body(vehicle_tables(name), commands, neutral=True).steady([0.9 * speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    # The A9's fins are printed to 1e-9 and a few 1e-6 askew.
    np.testing.assert_allclose(steady, [speed, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-4 if name == "eca_a9" else 1e-9)


def test_the_independent_motion_turns_the_remus_as_printed():
    """The equations of tests/support/steady_motion.py, on the vehicle that has its own second copy (tests/laws)."""
    body = Body(vehicle_tables("remus_100"), {"wrench": {"force": [3.86, 0.0, 0.0], "torque": [0.0] * 3}}, neutral=True)
    from tests.laws import test_remus_100 as remus

    rng = np.random.default_rng(3)
    for _ in range(20):
        v = rng.normal(size=6) * [1.0, 0.3, 0.3, 0.2, 0.2, 0.2]
        down = down_of(*rng.normal(size=2) * 0.3)
        np.testing.assert_allclose(
            body.acceleration(v, down), remus.acceleration(v, down, 0.0, remus.LEVER), rtol=2e-5, atol=1e-6
        )
