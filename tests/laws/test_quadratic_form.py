# SPDX-License-Identifier: Apache-2.0
"""Products of two velocities: against sums over dense tables, drag in closed form, other laws, and a published vehicle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import lgvi_warp as lw
from tests.laws.test_device_code import assert_close, bench_of, measured
from tests.laws.test_water_gradients import accelerations
from tests.support.tools import GRAVITY, difference, last, one, slope

FORCES, VELOCITIES = "XYZKMN", "uvwpqr"


def random_form(rng, count):
    """Names, values, and dense tables of some products, some of them in the same element."""
    tables = {"c": np.zeros((6, 6, 6)), "d": np.zeros((6, 6, 6))}
    names, values, used = [], [], set()
    while len(names) < count:
        i, j, k = rng.integers(0, 6, 3).tolist()
        kind = rng.choice(["c", "d"])
        key = (kind, i, *(sorted((j, k)) if kind == "c" else (j, k)))
        if key in used:
            continue
        used.add(key)
        value = rng.normal()
        tables[kind][i, j, k] = value
        factor = VELOCITIES[j] if kind == "c" else f"|{VELOCITIES[j]}|"
        # Either order of the factors.
        pair = (factor, VELOCITIES[k]) if rng.random() < 0.5 else (VELOCITIES[k], factor)
        names.append(f"{FORCES[i]}_{''.join(pair)}")
        values.append(value)
    return names, values, tables


@pytest.mark.ci
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("axes", ["any", "others", "the user's"])
def test_random_forms_are_sums_over_tables(seed, axes):
    names, values, tables = random_form(np.random.default_rng(seed), 15)
    term = lw.terms.QuadraticForm(products=names, values=values)
    device = None
    if axes == "the user's":
        device = f"{term.pattern_device}:{','.join(term.entries({'values': term.values[None]}))}"
    bench = bench_of(term, "laws", axes == "the user's", device)
    bench.views.velocity[0] = 0.0
    got, _ = measured(bench, axes == "others")
    v = np.concatenate([bench.views.velocity, bench.views.rate], axis=1)
    exact = np.einsum("ijk,nj,nk->ni", tables["c"], v, v) + np.einsum("ijk,nj,nk->ni", tables["d"], np.abs(v), v)
    for role in ("damping", "push"):
        assert_close(got[role], exact)


BODY = lw.Vehicle(30.0, inertia=(0.3, 4.0, 4.0), added_mass=(1.0, 30.0, 30.0), buoyancy=30.0 * GRAVITY)


def in_water(*terms, vehicle=BODY):
    return lw.Scene(vehicle, lw.Environment(GRAVITY), terms=list(terms))


@pytest.mark.ci
@pytest.mark.slow_but("X_uu-psi_s-2.0", "X_u|vw|-rk4-4.0")
@pytest.mark.parametrize(("method", "order"), [("psi_s", 2.0), ("rk4", 4.0)])
@pytest.mark.parametrize("name", ["X_uu", "X_u|u|", "X_u|vw|"])
def test_a_run_straight_ahead_slows_down_as_its_closed_form(name, method, order):
    # (m + A11) u' = X u^2: u = 1 / (1 / u0 + k t). Of the speed across, u' = X s u: exponential.
    k, u0, t1 = 9.0 / 31.0, 2.0, 2.0
    scene = in_water(lw.terms.QuadraticForm.of({name: -9.0}))
    across = 0.7 if "vw" in name else 0.0
    exact = u0 * np.exp(-k * across * t1) if across else 1.0 / (1.0 / u0 + k * t1)
    steps = np.array([0.2, 0.1, 0.05])
    # Beside the speed across there are Munk's moment and none of its own: the vehicle is held from turning by its inertia.
    vehicle = replace(BODY, inertia=(1e12,) * 3, added_mass=(1.0,) * 3) if across else BODY
    scene = in_water(*scene.terms, vehicle=vehicle)
    fleet = one(scene, nu=(u0, 0.6 * across, 0.8 * across))
    errors = [abs(last(lw.solve(fleet, method, h=h, t1=t1))[2][0] - exact) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.25)
    assert errors[-1] < {"psi_s": 2e-3, "rk4": 1e-6}[method]


@pytest.mark.ci
@pytest.mark.parametrize("method", [pytest.param("psi_x", marks=pytest.mark.slow), "rk4"])
def test_remus_by_its_names_is_remus_by_its_matrices(method):
    scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.1, -0.1], "angular_velocity": [0.1, 0.1, -0.2]})
    drag = next(term for term in scene.terms if term.type == "drag_matrix")
    lift = next(term for term in scene.terms if term.type == "body_lift")
    named = {}
    for i, j in np.argwhere(drag.quadratic):
        named[f"{FORCES[i]}_{VELOCITIES[j]}|{VELOCITIES[j]}|"] = -drag.quadratic[i, j]
    for i, j in np.argwhere(lift.matrix):
        named[f"{FORCES[i]}_u{VELOCITIES[j]}"] = -lift.matrix[i, j]
    rest = [term for term in scene.terms if term.type not in ("drag_matrix", "body_lift")]
    by_names = replace(scene, terms=[*rest, lw.terms.QuadraticForm.of(named)])
    ends = [last(lw.solve(each, method, h=0.02, t1=5.0)) for each in (scene, by_names)]
    # Round-off of 250 steps in another order of sums, in a vehicle that is unstable in pitch.
    assert difference(*ends) < 1e-11


# NPS AUV II, dimensionless as printed: Healey and Lienard (1993), IEEE J. Oceanic Eng. 18(3). No thrusters, no fins, and
# without the integrals of cross-flow drag.
LENGTH, RHO = 5.3, 1025.0
WEIGHT, FREE_FALL, BELOW = 53400.0, 9.81, 0.061
NPS = {
    "Xpp": 7.0e-3, "Xqq": -1.5e-2, "Xrr": 4.0e-3, "Xpr": 7.5e-4, "Xwq": -2.0e-1, "Xvp": -3.0e-3, "Xvr": 2.0e-2,
    "Xvv": 5.3e-2, "Xww": 1.7e-1,
    "Ypq": 4.0e-3, "Yqr": -6.5e-3, "Yp": 3.0e-3, "Yr": 3.0e-2, "Yvq": 2.4e-2, "Ywp": 2.3e-1, "Ywr": -1.9e-2, "Yv": -1.0e-1,
    "Yvw": 6.8e-2,
    "Zpp": 1.3e-4, "Zpr": 6.7e-3, "Zrr": -7.4e-3, "Zq": -1.4e-1, "Zvp": -4.8e-2, "Zvr": 4.5e-2, "Zw": -3.0e-1, "Zvv": -6.8e-2,
    "Kpq": -6.9e-5, "Kqr": 1.7e-2, "Kp": -1.1e-2, "Kr": -8.4e-4, "Kvq": -5.1e-3, "Kwp": -1.3e-4, "Kwr": 1.4e-2, "Kv": 3.1e-3,
    "Kvw": -1.9e-1,
    "Mpp": 5.3e-5, "Mpr": 5.0e-3, "Mrr": 2.9e-3, "Mq": -6.8e-2, "Mvp": 1.2e-3, "Mvr": 1.7e-2, "Mw": 1.0e-1, "Mvv": -2.6e-2,
    "Npq": -2.1e-2, "Nqr": 2.7e-3, "Np": -8.4e-4, "Nr": -1.6e-2, "Nvq": -1.0e-2, "Nwp": -1.7e-2, "Nwr": 7.4e-3, "Nv": -7.4e-3,
    "Nvw": -2.7e-2,
}  # fmt: skip
ADDED = {"Xu": -7.6e-3, "Yp": 1.2e-4, "Yr": 1.2e-3, "Yv": -5.5e-2, "Zq": -6.8e-3, "Zw": -2.4e-1, "Kp": -1.0e-3, "Kr": -3.4e-5,
         "Kv": 1.2e-4, "Mq": -1.7e-2, "Mw": -6.8e-3, "Np": -3.4e-5, "Nr": -3.4e-3, "Nv": 1.2e-3}  # fmt: skip


def size_of(name):
    """Factor of a dimensionless coefficient; one velocity alone stands beside u."""
    return 0.5 * RHO * LENGTH ** (2 + (name[0] in "KMN") + sum(letter in "pqr" for letter in name[1:]))


def added_mass():
    A = np.zeros((6, 6))
    for name, value in ADDED.items():
        rates = (name[0] in "KMN") + (name[1] in "pqr")
        A[FORCES.index(name[0]), VELOCITIES.index(name[1])] = -0.5 * RHO * LENGTH ** (3 + rates) * value
    return A


def nps_scene():
    mass = WEIGHT / FREE_FALL
    inertia = np.array([[2038.0, 13.58, 13.58], [13.58, 13587.0, 13.58], [13.58, 13.58, 13587.0]])
    S = lw.notation.hat(np.array([0.0, 0.0, BELOW]))
    rigid = np.block([[mass * np.eye(3), -mass * S], [mass * S, inertia]])
    body = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=added_mass(), weight=WEIGHT, buoyancy=WEIGHT,
                      center_of_gravity=(0.0, 0.0, BELOW))  # fmt: skip
    form = lw.terms.QuadraticForm.gertler_hagen(NPS, rho=RHO, length=LENGTH, added_mass=added_mass())
    return lw.Scene(body, lw.Environment(FREE_FALL, water_density=RHO), terms=[form])


@pytest.mark.slow
def test_a_published_vehicle_accelerates_as_its_equations_say():
    # m (v' + Om x v + Om' x g + Om x (Om x g)) = F, I Om' + Om x I Om + m g x (v' + Om x v) = T: with the printed forces,
    # which hold all that the added mass makes but its part of the accelerations.
    scene, rng = nps_scene(), np.random.default_rng(6)
    rigid, A = np.asarray(scene.vehicle.rigid_body_mass_matrix), added_mass()
    mass, I, g = rigid[0, 0], rigid[3:, 3:], np.array([0.0, 0.0, BELOW])  # noqa: E741
    for _ in range(4):
        v = np.concatenate([[2.0, 0.3, -0.2] + 0.2 * rng.normal(size=3), 0.2 * rng.normal(size=3)])
        F = np.zeros(6)
        for name, value in NPS.items():
            letters = name[1:] if len(name) == 3 else f"u{name[1:]}"
            pair = v[VELOCITIES.index(letters[0])] * v[VELOCITIES.index(letters[1])]
            F[FORCES.index(name[0])] += size_of(name) * value * pair
        nu, Om = v[:3], v[3:]
        inertial = np.cross(Om, nu) + np.cross(Om, np.cross(Om, g))
        F -= np.concatenate([mass * inertial, np.cross(Om, I @ Om) + mass * np.cross(g, np.cross(Om, nu))])
        expected = np.linalg.solve(rigid + A, F)
        # Upright, weight and buoyancy have no moment.
        got = accelerations(one(scene, nu=nu, Om=Om), "rk4", 2e-3)
        inertial_rate, rate = got[0][0], got[1][0]
        np.testing.assert_allclose(inertial_rate - np.cross(Om, nu), expected[:3], atol=1e-8)
        np.testing.assert_allclose(rate, expected[3:], atol=1e-8)


@pytest.mark.ci
@pytest.mark.parametrize(("method", "order"), [pytest.param("psi_x", 2.0, marks=pytest.mark.slow), ("rk4", 4.0)])
def test_orders_of_a_published_vehicle(method, order):
    fleet = one(nps_scene(), nu=(2.0, 0.2, -0.1), Om=(0.1, 0.1, -0.2))
    steps = np.array([0.2, 0.1, 0.05])
    truth = last(lw.solve(fleet, "rk4", h=0.00625, t1=4.0))
    errors = [difference(last(lw.solve(fleet, method, h=h, t1=4.0)), truth) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.3)


# The DSRV of 5 m, dimensionless as printed: Healey (1992), lecture notes, Naval Postgraduate School; read in MSS, DSRV.m.
RESCUE, SPEED = 5.0, 4.11
DSRV = {"Zq": -0.017455, "Zw": -0.043938, "Mq": -0.01131, "Mw": 0.011175}
DSRV_MASS, DSRV_INERTIA, RIGHTING = 0.036391, 0.001925, -0.156276
DSRV_ADDED = {(2, 2): 0.031545, (2, 4): 0.000130, (4, 2): 0.000146, (4, 4): 0.001573}


def dsrv():
    """The vehicle, and its matrix of w', q' [kg, kg m, kg m2]."""
    unit = 0.5 * RHO * RESCUE**3
    added = np.zeros((6, 6))
    for (i, j), value in DSRV_ADDED.items():
        added[i, j] = unit * value * RESCUE ** ((i > 2) + (j > 2))
    # Printed Z_qdot and M_wdot differ by a tenth; no added mass does.
    added[2, 4] = added[4, 2] = 0.5 * (added[2, 4] + added[4, 2])
    mass, inertia = unit * DSRV_MASS, unit * RESCUE**2 * DSRV_INERTIA
    weight, below = mass * GRAVITY, -RIGHTING * unit / (mass * GRAVITY)
    # About the centre of gravity, which lies below that of buoyancy: M'theta is printed times U^2 [m2/s2].
    body = lw.Vehicle(rigid_body_mass_matrix=np.diag([mass] * 3 + [inertia] * 3), added_mass_matrix=added, weight=weight,
                      buoyancy=weight, center_of_buoyancy=(0.0, 0.0, -below))  # fmt: skip
    form = lw.terms.QuadraticForm.gertler_hagen(DSRV, rho=RHO, length=RESCUE, added_mass=added)
    return lw.Scene(body, lw.Environment(GRAVITY, water_density=RHO), terms=[form]), added[[2, 4]][:, [2, 4]], unit


@pytest.mark.slow
def test_a_rescue_vehicle_swings_as_its_linear_equations_say():
    # m (w' - U q) = Z, I q' = M + M'theta theta, theta' = q: small motions about U ahead, by the exponential of the matrix.
    scene, added, unit = dsrv()
    A = np.zeros((3, 3))
    A[0, :2] = unit / RESCUE * SPEED * np.array([DSRV["Zw"], RESCUE * DSRV["Zq"] + RESCUE * DSRV_MASS])
    A[1, :2] = unit * SPEED * np.array([DSRV["Mw"], RESCUE * DSRV["Mq"]])
    A[1, 2], A[2, 1] = unit * RIGHTING, 1.0
    M = np.eye(3)
    M[:2, :2] = added + unit * np.diag([DSRV_MASS, RESCUE**2 * DSRV_INERTIA])
    t1, begun = 2.0, 1e-5 * np.array([SPEED, 1.0, 0.0])
    expected = expm(np.linalg.solve(M, A) * t1) @ begun
    result = lw.solve(one(scene, nu=(SPEED, 0.0, begun[0]), Om=(0.0, begun[1], 0.0)), "rk8", h=0.05, t1=t1)
    R = result.attitude[-1, 0]
    got = np.array([result.velocity[-1, 0, 2], result.angular_velocity[-1, 0, 1], np.arctan2(-R[2, 0], R[2, 2])])
    # What is left out is of second order: some 1e-5 of them.
    assert np.abs(got - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(expected).max() > 0.1 * np.abs(begun).max()


@pytest.mark.ci
def test_no_published_vehicle_is_told_to_drive_itself():
    for scene in (nps_scene(), dsrv()[0]):
        assert not [text for text in lw.solve(scene, "rk4", h=0.1, t1=0.1).messages if "quadratic_form" in text]


@pytest.mark.ci
def test_members_with_entries_of_their_own():
    form = lw.terms.QuadraticForm.of({"X_u|u|": -3.0, "Y_uv": -20.0, "N_uv": 5.0, "N_r|r|": -10.0})
    wake = lw.terms.QuadraticForm(name="wake", products=["Z_w|vw|", "M_|w|q"], values=[-50.0, -20.0])
    values = np.array([-20.0, 0.0, -35.0])
    state = {"nu": (1.5, 0.2, 0.1), "Om": (0.0, 0.1, 0.1)}
    together = one(in_water(form, wake), **state, parameters={"quadratic_form.values[1]": values})
    result = lw.solve(together, "psi_s", h=0.02, t1=1.0)
    assert np.ptp(result.velocity[-1, :, 1]) > 1e-3
    for i, value in enumerate(values):
        alone = lw.terms.QuadraticForm.of({"X_u|u|": -3.0, "Y_uv": value, "N_uv": 5.0, "N_r|r|": -10.0})
        end = last(lw.solve(one(in_water(alone, wake), **state), "psi_s", h=0.02, t1=1.0))
        assert difference(end, last(result, i)) < 1e-14


def test_standard_names():
    read = lw.terms.QuadraticForm.gertler_hagen
    units = {"rho": 2.0, "length": 1.0}
    names = {"X'uu": "X_uu", "Z'*": "Z_uu", "Zw'": "Z_uw", "M'|w|": "M_u|w|", "Y'v|v|": "Y_|vw|v", "N'|v|r": "N_|vw|r",
             "Z'w|q|": "Z_w|q|", "K'p|p|": "K_p|p|", "Z'ww": "Z_ww", "X'wq": "X_wq"}  # fmt: skip
    form = read(dict.fromkeys(names, 1.0), **units)
    same = lw.terms.QuadraticForm.of(dict.fromkeys(names.values(), 1.0))
    assert form.forms == same.forms
    np.testing.assert_array_equal(form.values, same.values)
    # Of metres: force L^2, moment L^3, and one more for each rate.
    assert read({"Xuu": 1.0, "Nuv": 1.0, "Mq|q|": 1.0, "Yr": 1.0}, rho=2.0, length=3.0).values.tolist() == [
        9,
        27,
        243,
        27,
    ]
    faults = {"X'udot": "added_mass_matrix", "Z'ds": "control_fins", "Y_udelta": "control_fins", "Q'uu": "is not a",
              "Xu": "is not a", "Y|v||r|": "is not a"}  # fmt: skip
    with pytest.raises(lw.SceneError) as error:
        read(dict.fromkeys(faults, 1.0), **units)
    for (key, words), text in zip(faults.items(), error.value.faults, strict=True):
        assert key in text
        assert words in text
    assert read(dict.fromkeys(faults, 1.0) | {"Xuu": 1.0}, **units, ignore=faults).products == ("X_uu",)
    with pytest.raises(lw.SceneError, match="twice"):
        read({"Zw": 1.0, "Z'w": 1.0}, **units)


def test_what_is_refused():
    for products, values, words in (
        (["X_uv", "X_vu"], [1.0, 1.0], "twice"),
        (["X_uv"], [1.0, 1.0], "Give one for each"),
        (["X_u"], [1.0], "not a product"),
        ("X_uu", [1.0, 2.0], "Give one for each"),
        ([3.0], [1.0], "products"),
        (["X_uu"], [np.nan], "values"),
    ):
        with pytest.raises(lw.SceneError, match=words):
            lw.terms.QuadraticForm(products=products, values=values)
    table = {"type": "quadratic_form", "products": ["X_uu", "Y_|vw|v"], "values": [-1.0, -2.0]}
    scene = in_water(table)
    assert scene.to_dict()["terms"] == [table]
    assert lw.Scene.from_dict(scene.to_dict()).terms[0].products == ("X_uu", "Y_|vw|v")
