# SPDX-License-Identifier: Apache-2.0
"""The vehicles that come with the package: sources on every line, sound matrices, and the physics they must have."""

import re
import tomllib

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.vehicles import fossen as co
from tests.conftest import ROOT

NAMES = co.vehicle_names()
SIMPLE = [name for name in NAMES if name not in ("remus_100", "eca_a9")]


def content(name):
    return tomllib.loads(co.vehicle_file(name).read_text(encoding="utf-8"))


def term(name, kind):
    (found,) = [t for t in content(name)["terms"] if t["type"] == kind]
    return {key: np.array(value) if isinstance(value, list) else value for key, value in found.items()}


def test_the_list():
    assert NAMES == ["bluerov2_heavy", "dsrv", "eca_a9", "girona_500", "lauv", "nordkvist_sanyal", "remus_100", "rexrov",
                     "seawing", "slocum", "sphere", "torpedo"]  # fmt: skip
    with pytest.raises(lw.SceneError, match="Did you mean 'remus_100'"):
        co.vehicle_file("remus100")


@pytest.mark.parametrize("name", NAMES)
def test_every_line_with_a_number_names_its_unit_and_source(name):
    for line in co.vehicle_file(name).read_text(encoding="utf-8").splitlines():
        code, _, comment = line.partition("#")
        code = re.sub(r'"[^"]*"', "", code)
        if re.search(r"[=\[,]\s*-?\d", code):
            assert re.match(r"\s*(kg|m2?|N|rad|1/rad|unit|s|dimensionless)\b", comment), line


@pytest.mark.parametrize("name", NAMES)
def test_tables(name):
    tables = content(name)
    assert set(tables) <= {"vehicle", "environment", "terms", "source"}
    source = tables["source"]
    assert {"title", "reference", "missing"} <= set(source)
    assert all(isinstance(text, str) and text for text in source.values())


def total_matrix(name):
    """The 6x6 inertia about the body origin."""
    v = content(name)["vehicle"]
    if "mass" not in v:
        return np.array(v["rigid_body_mass_matrix"]) + np.array(v["added_mass_matrix"])
    return np.diag([*(v["mass"] + np.array(v["added_mass"])), *v["inertia"]])


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_symmetric_positive_definite(name):
    M = total_matrix(name)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0.0


def test_the_remus_matrices_follow_from_the_printed_derivatives():
    v = content("remus_100")["vehicle"]
    printed = {"X_udot": -0.93, "Y_vdot": -35.5, "Z_wdot": -35.5, "K_pdot": -7.04e-2, "M_qdot": -4.88, "N_rdot": -4.88}
    printed |= {"Y_rdot": 1.93, "N_vdot": 1.93, "Z_qdot": -1.93, "M_wdot": -1.93}
    printed |= {"X_uu": -1.62, "Y_vv": -1310.0, "Y_rr": 0.632, "Z_ww": -131.0, "Z_qq": -0.632, "K_pp": -0.13}
    printed |= {"M_ww": 3.18, "M_qq": -188.0, "N_vv": -3.18, "N_rr": -94.0}
    made = co.from_fossen(printed, mass=30.48, inertia=(0.177, 3.45, 3.45),
                                         center_of_gravity=(0.0, 0.0, 0.0196), weight=299.0, buoyancy=308.0)  # fmt: skip
    for key, value in made["vehicle"].items():
        np.testing.assert_allclose(v[key], value, rtol=1e-14, atol=1e-15, err_msg=key)
    assert made["terms"] == [t for t in content("remus_100")["terms"] if t["type"] == "drag_matrix"]


def test_the_remus_added_mass_implies_the_printed_cross_terms():
    """Momentum A nu turned with the body: Prestero's tables C.6 and C.8, to the digits printed there."""
    A = np.array(content("remus_100")["vehicle"]["added_mass_matrix"])

    def forces(**velocity):
        nu = np.array([velocity.get(letter, 0.0) for letter in "uvwpqr"])
        p, pi = (A @ nu)[:3], (A @ nu)[3:]
        return np.concatenate([np.cross(p, nu[3:]), np.cross(pi, nu[3:]) + np.cross(p, nu[:3])])

    def product(i, a, b):
        return forces(**{a: 1.0, b: 1.0})[i] - forces(**{a: 1.0})[i] - forces(**{b: 1.0})[i]

    printed = {"Xwq": -35.5, "Xvr": 35.5, "Yur": -0.93, "Ywp": 35.5, "Ypq": 1.93, "Zuq": 0.93, "Zvp": -35.5,
               "Zrp": 1.93}  # fmt: skip
    printed |= {"Muw": 34.6, "Muq": 1.93, "Mvp": -1.93, "Nuv": -34.6, "Nur": 1.93, "Nwp": -1.93}
    for name, value in printed.items():
        assert product("XYZKMN".index(name[0]), *name[1:]) == pytest.approx(value, abs=0.05), name
    assert forces(q=1.0)[0] == forces(r=1.0)[0] == -1.93
    # Printed 4.86 and -4.86: 1 % off what K_pdot and N_rdot of the same thesis give.
    assert product(4, "r", "p") == pytest.approx(4.86, rel=0.011)
    assert product(5, "p", "q") == pytest.approx(-4.86, rel=0.011)


def fin_forces(u, v, w, q, r, command, density=1030.0):
    """Lift of the REMUS' control fins, 1/2 rho A a sin(alpha) cos(alpha) V^2 along the normal, forces and moments."""
    t, total = term("remus_100", "control_fins"), np.zeros(6)
    for n, x in enumerate(t["position"]):
        velocity = np.array([u, v, w]) + np.cross([0.0, q, r], x)
        turn = np.cos(command[n]), np.sin(command[n])
        chord = turn[0] * t["chord"][n] - turn[1] * -t["normal"][n]
        normal = turn[0] * t["normal"][n] - turn[1] * t["chord"][n]
        lift = -0.5 * density * t["area"][n] * t["lift_slope"][n] * (velocity @ chord) * (velocity @ normal)
        total += np.concatenate([lift * t["normal"][n], np.cross(x, lift * t["normal"][n])])
    return total


def test_the_remus_fins_have_the_printed_coefficients():
    """Table C.10: what is bilinear in u and v, w, q, r, and what a small angle adds."""
    small = 1e-6
    printed = {"v": (1, -9.64, 5, 6.15), "w": (2, -9.64, 4, -6.15), "q": (2, -6.15, 4, -3.93), "r": (1, 6.15, 5, -3.93)}
    for letter, (i, force, k, moment) in printed.items():
        motion = {"v": 0.0, "w": 0.0, "q": 0.0, "r": 0.0} | {letter: small}
        found = fin_forces(2.0, command=(0.0, 0.0), **motion) / (2.0 * small)
        assert found[i] == pytest.approx(force, abs=0.01), letter
        assert found[k] == pytest.approx(moment, abs=0.01), letter
    rudder = fin_forces(2.0, 0.0, 0.0, 0.0, 0.0, (small, 0.0)) / (4.0 * small)
    stern = fin_forces(2.0, 0.0, 0.0, 0.0, 0.0, (0.0, small)) / (4.0 * small)
    assert rudder[1] == pytest.approx(9.64, abs=0.01)
    assert rudder[5] == pytest.approx(-6.15, abs=0.01)
    assert stern[2] == pytest.approx(-9.64, abs=0.01)
    assert stern[4] == pytest.approx(-6.15, abs=0.01)


@pytest.mark.parametrize("name", ["remus_100", "bluerov2_heavy", "lauv", "girona_500", "rexrov"])
def test_drag_never_adds_energy(name):
    found = next(t for t in content(name)["terms"] if t["type"].startswith("drag"))
    linear, quadratic = (np.array(found[key]) for key in ("linear", "quadratic"))
    if linear.ndim == 1:
        linear, quadratic = np.diag(linear), np.diag(quadratic)
    nu = np.random.default_rng(0).normal(size=(100000, 6)) * 10.0 ** np.random.default_rng(1).uniform(
        -2, 1, (100000, 6)
    )
    power = -np.einsum("ni,ij,nj->n", nu, linear, nu) - np.einsum("ni,ij,nj->n", nu, quadratic, np.abs(nu) * nu)
    assert power.max() <= 0.0


def test_bluerov2_thrusters_reach_every_motion():
    t = term("bluerov2_heavy", "thrusters")
    np.testing.assert_allclose(np.linalg.norm(t["direction"], axis=1), 1.0, rtol=1e-15)
    allocation = np.hstack([t["direction"], np.cross(t["position"], t["direction"])])
    assert np.linalg.matrix_rank(allocation) == 6
    # Arms of the second transcript's allocation matrix.
    np.testing.assert_allclose(np.abs(allocation[:4, 5]), 0.1888, atol=5e-5)
    np.testing.assert_allclose(np.abs(allocation[4:, 3:5]), [[0.218, 0.12]] * 4)
    assert len(t["coefficient"]) == len(t["command"]) == 8


@pytest.mark.ci
def test_bluerov2_thrust_is_the_published_curve():
    """Eq. 18 of von Benzon et al. 2022; a quarter of the greatest thrust, as of c V|V|, is 46 % of it at V = 0.5."""
    scene = lw.Scene.from_dict({"vehicle": {"name": "bluerov2_heavy"}})
    thrusters = next(term for term in scene.terms if term.type == "thrusters")
    V = np.linspace(-1.0, 1.0, 41)[:, None] * np.ones(8)
    published = -140.3 * V**9 + 389.9 * V**7 - 404.1 * V**5 + 176.0 * V**3 + 8.9 * V
    np.testing.assert_allclose(thrusters.thrust(V), published, atol=1e-12)
    assert thrusters.thrust(np.full(8, 0.5))[0] == pytest.approx(16.594, abs=1e-3)
    for row in published:
        np.testing.assert_allclose(thrusters.thrust(thrusters.command_for(row)), row, atol=1e-9)
    most = thrusters.command_for(np.full(8, 99.0))
    np.testing.assert_allclose(most, 0.9717, atol=1e-4)


def test_commands_for_thrusts():
    """The inverse of a curve with a dead band, of another shape astern; the least command; 0 for 0; the limit beyond reach."""
    numbers = {"position": [[0.0, 0.0, 0.0]] * 3, "direction": [[1.0, 0.0, 0.0]] * 3, "dead_band": [0.0, 0.1, 0.1],
               "limit": 0.9}  # fmt: skip
    square = lw.terms.Thrusters(coefficient=[10.0, 20.0, 0.0], coefficient_astern=[5.0, 10.0, 1.0], **numbers)
    np.testing.assert_allclose(square.command_for([2.5, -2.5, 1.0]), [0.5, -0.6, 0.0], rtol=1e-12)
    curved = lw.terms.Thrusters(polynomial=[2.0, 0.0, 40.0], polynomial_astern=[3.0], **numbers)
    thrust = np.array([5.0, -1.0, 0.0])
    np.testing.assert_allclose(curved.thrust(curved.command_for(thrust)), thrust, rtol=1e-12)
    assert curved.command_for([1e3, -1e3, 0.0]).tolist() == [0.9, -0.9, 0.0]
    np.testing.assert_allclose(curved.coefficient, 1.0)


def test_the_sphere_is_exact():
    """Added mass half the displaced mass, isotropic; 2/5 m a^2; neutral."""
    v, rho, a = content("sphere")["vehicle"], content("sphere")["environment"]["water_density"], 0.25
    m = 4.0 / 3.0 * np.pi * rho * a**3
    np.testing.assert_allclose(v["mass"], m, rtol=1e-15)
    np.testing.assert_allclose(v["added_mass"], 3 * [m / 2.0], rtol=1e-15)
    np.testing.assert_allclose(v["inertia"], 3 * [0.4 * m * a * a], rtol=1e-15)
    np.testing.assert_allclose(v["buoyancy"], m * 9.80665, rtol=1e-15)


def test_the_spheroid_is_exact():
    """The closed forms against quadrature of Lamb's integrals, art. 114: alpha_i = a b c int ds/((a_i^2 + s) Delta)."""
    from scipy.integrate import quad

    v, rho, a, b = content("torpedo")["vehicle"], content("torpedo")["environment"]["water_density"], 0.8, 0.1
    m = 4.0 / 3.0 * np.pi * rho * a * b * b

    def integral(axis):
        # s = b^2 (1/t^2 - 1) maps 0 .. infinity to 1 .. 0; Delta = sqrt(a^2 + s) (b^2 + s)
        def f(t):
            s = b * b * (1.0 / t**2 - 1.0)
            return 2.0 * b * b / t**3 / ((axis**2 + s) * np.sqrt(a * a + s) * (b * b + s))

        return a * b * b * quad(f, 0.0, 1.0, epsabs=0.0, epsrel=1e-12)[0]

    alpha, beta = integral(a), integral(b)
    assert alpha + 2.0 * beta == pytest.approx(2.0, rel=1e-11)
    k1, k2 = alpha / (2.0 - alpha), beta / (2.0 - beta)
    # Lamb, art. 115: 1/5 (a^2 - b^2)^2 (beta - alpha)/(2 (a^2 - b^2) + (a^2 + b^2)(alpha - beta)) m
    gap, both = a * a - b * b, a * a + b * b
    added = m / 5.0 * gap**2 * (beta - alpha) / (2.0 * gap - both * (beta - alpha))
    np.testing.assert_allclose(v["mass"], m, rtol=1e-15)
    np.testing.assert_allclose(v["added_mass"], [k1 * m, k2 * m, k2 * m], rtol=1e-9)
    np.testing.assert_allclose(v["inertia"], [0.4 * m * b * b, *2 * [m / 5.0 * both + added]], rtol=1e-9)
    np.testing.assert_allclose(v["buoyancy"], m * 9.80665, rtol=1e-15)


def test_the_papers_vehicle_is_that_of_the_example():
    from pathlib import Path

    example = lw.Scene.load(Path(__file__).parents[3] / "examples" / "paper.toml")
    found = content("nordkvist_sanyal")
    assert lw.Vehicle(**found["vehicle"]).to_dict() == example.vehicle.to_dict()
    assert found["environment"]["gravity"] == example.environment.gravity


@pytest.mark.parametrize("name", SIMPLE)
def test_simple_vehicles_load(name):
    assert lw.Vehicle(**content(name)["vehicle"]).warnings == ()


def test_the_vehicle_of_a_doubtful_inertia_says_so():
    (warning,) = lw.Vehicle(**content("eca_a9")["vehicle"]).warnings
    assert "no rigid body has" in warning


def test_the_full_vehicle_loads():
    given = content("remus_100")["vehicle"]
    np.testing.assert_array_equal(lw.Vehicle(**given).added_mass_matrix, given["added_mass_matrix"])


def test_the_rov_that_pitches_over_is_said_to(capsys):
    """Thrusters that push below the centre of gravity by more than buoyancy rights leave no steady pitch."""
    scene, said = lw.Scene.named("bluerov2_heavy"), "15.5 N"
    body, (thrusters,) = scene.vehicle, [term for term in scene.terms if term.type == "thrusters"]
    arm, righting = thrusters.position[:4, 2], float(body.buoyancy) * abs(body.center_of_buoyancy[2])
    assert np.all(arm == 0.085)
    assert f"{righting / 0.085:.1f} N" == said
    assert f"{righting:.2f}" == "1.32"
    ahead = np.abs(thrusters.direction[:4, 0]) @ thrusters.thrust(np.ones(8))[:4]
    assert f"{ahead:.0f}" == "86"
    assert ahead * 0.085 > 5.0 * righting
    assert cli.main(["list", "vehicles"]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("bluerov2_heavy")]
    page = (ROOT / "docs" / "guide" / "vehicles.md").read_text()
    assert all(number in text for text in (line, page) for number in (said, "0.085 m", "1.32 N m"))
    assert "The full push ahead is 86 N" in page
