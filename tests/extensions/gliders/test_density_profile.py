# SPDX-License-Identifier: Apache-2.0
"""A table of the density that hull, ballast and engine share: against root finding, quadrature, TEOS-10 and the twins."""

import numpy as np
import pytest
from scipy import integrate, optimize

import lgvi_warp as lw
from lgvi_warp.extensions.gliders.twin.ballast import Ballast
from lgvi_warp.extensions.gliders.twin.buoyancy_engine import BuoyancyEngine
from lgvi_warp.extensions.gliders.twin.density_profile import DensityProfile
from lgvi_warp.reference.terms.drag import Drag
from tests.extensions.gliders.cases import BUOYANCY, CENTER_OF_BUOYANCY, ENGINE, WATER
from tests.laws.case import Case
from tests.laws.test_parity import STATE, VEHICLE, both, scene_of
from tests.support.tools import difference, one

CAST = dict(depths=[-1.0, 3.0, 7.9, 8.3, 40.0], densities=[1000.0, 1010.0, 1024.0, 1040.0, 1060.0])
PROFILE = lw.terms.DensityProfile(**CAST)
HULL = dict(buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY, density=WATER["density"])
VOLUMES = dict(position=((0.4, 0.0, 0.1), (-0.5, 0.02, 0.0)), command=(2e-4, -3e-4))
PUMP = {name: value for name, value in ENGINE.items() if name not in ("gradient", "reference_depth")}
LINEAR = (3.0, 4.0, 5.0, 0.3, 0.4, 0.5)


def case(**profile):
    """Drag, hull, ballast that is held, and an engine, all in the water of one table."""
    arrays = {name: np.asarray(value) for name, value in (CAST | profile).items()}
    twin = DensityProfile(**arrays, **HULL)
    held = Ballast(position=np.array(VOLUMES["position"]), times=np.zeros(1), command=np.array([VOLUMES["command"]]),
                   limit=np.full(2, 1e6), profile=twin, **WATER)  # fmt: skip
    engine = BuoyancyEngine(**{name: np.asarray(value) for name, value in PUMP.items()}, profile=twin, **WATER)
    drag = Drag(linear=np.array(LINEAR), quadratic=np.zeros(6))
    terms = (lw.terms.Drag(linear=LINEAR), lw.terms.DensityProfile(**CAST, **profile), lw.terms.Ballast(**VOLUMES),
             lw.terms.BuoyancyEngine(**PUMP))  # fmt: skip
    return Case(terms, (drag, twin, held, engine))


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("profile", [{}, {"compressibility": 0.01, "reference_depth": 2.0}], ids=["stiff", "yielding"])
def test_hull_ballast_and_engine_are_those_of_the_twins(profile):
    # Whose forces are rho(d) g V as printed. From 8 m on through two of the layers: 100 steps of round-off.
    kernel, twin = both(case(**profile), "psi_s", 0.02, 100)
    assert difference(kernel, twin) < 2e-12


@pytest.mark.slow
@pytest.mark.kernel
def test_a_neutral_body_comes_to_rest_where_its_density_is():
    # m = rho(z) (V + ballast + engine), the hull's V = B / (rho0 g), by root finding. Stiffness 2.4 N/m, drag 16 N s/m and
    # 27 kg: of the start exp(-0.29 t) is left, and nothing after 400 s.
    water = dict(depths=[0.0, 5.0, 20.0, 60.0], densities=[1000.0, 1020.0, 1200.0, 1800.0])
    engine = dict(pump_rate=1e-6, volume_down=-1e-3, volume_up=2e-3, depth_top=-500.0, depth_bottom=500.0)
    terms = [
        lw.terms.Drag(linear=[16.0, 16.0, 16.0, 10.0, 10.0, 10.0]),
        lw.terms.DensityProfile(**water),
        lw.terms.Ballast(position=((0.0, 0.0, 0.0),), command=(1.5e-3,)),
        lw.terms.BuoyancyEngine(**engine, volume_start=-1e-3),
    ]
    hull = lw.Vehicle(22.0, inertia=(1.5, 1.5, 1.5), added_mass=(5.0, 5.0, 5.0), buoyancy=20.0 * WATER["gravity"],
                      center_of_buoyancy=(0.0, 0.0, -0.02))  # fmt: skip
    scene = lw.Scene(hull, lw.Environment(gravity=WATER["gravity"], water_density=WATER["density"]), terms=terms)
    fleet = one(scene, b=(0.0, 0.0, 12.0))
    result = lw.solve(fleet, "psi_s", h=0.05, t1=400.0)
    volume = 20.0 / WATER["density"]

    def heavy(z):
        inside = np.interp(z, water["depths"], water["densities"])
        # The hull at its centre of buoyancy, 2 cm above the origin, where ballast and engine are.
        above = np.interp(z - 0.02, water["depths"], water["densities"])
        return above * volume + inside * (1.5e-3 - 1e-3) - 22.0

    assert result.position[-1, 0, 2] == pytest.approx(optimize.brentq(heavy, 0.0, 60.0), abs=1e-8)


def test_buoyancy_of_a_hull_is_rho_g_v():
    # Of the twin, weight included: to rounding.
    hull = DensityProfile(**{name: np.asarray(value) for name, value in CAST.items()}, **HULL)
    V = BUOYANCY / (WATER["density"] * WATER["gravity"])
    for depth in (-5.0, 0.0, 2.0, 8.1, 30.0, 100.0):
        view = one_view(depth)
        lift = BUOYANCY - hull.wrench(view)[0] @ view.down
        rho = np.interp(view.b[2] + view.down @ CENTER_OF_BUOYANCY, CAST["depths"], CAST["densities"])
        assert lift == pytest.approx(rho * WATER["gravity"] * V, rel=1e-14)


def one_view(depth):
    from lgvi_warp.reference.terms import View

    R = lw.notation.matrix_from_rotation_vector(np.array([0.3, -0.4, 0.8]))
    return View(R, np.array([0.0, 0.0, depth]), np.zeros(3), np.zeros(3))


def test_columns():
    # Host, twin and quadrature agree; the potential's slope is the force.
    numbers = {name: value[None] for name, value in PROFILE.parameters().items()}
    twin = DensityProfile(**{name: np.asarray(value) for name, value in CAST.items()}, **HULL)
    z = np.array([-4.0, -0.5, 0.0, 3.0, 8.1, 60.0])
    host = PROFILE.column(numbers, np.array([1025.0]), z[:, None])[:, 0] * 1025.0
    wanted = [integrate.quad(PROFILE.density_at, 0.0, x, points=CAST["depths"], limit=200)[0] for x in z]
    np.testing.assert_allclose(host, wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose([twin.column(x) for x in z], wanted, rtol=1e-9, atol=1e-9)


def test_a_cast_by_teos_10(tmp_path):
    gsw = pytest.importorskip("gsw")
    columns = dict(temperature=[28.8099, 28.4392, 22.7862], salinity=[34.5487, 34.7275, 34.8605])
    water = lw.terms.DensityProfile.from_cast(pressure=[10.0, 50.0, 125.0], **columns, latitude=4.0, longitude=188.0)
    SA = gsw.SA_from_SP(columns["salinity"], [10.0, 50.0, 125.0], 188.0, 4.0)
    # In-situ densities of the manual's cast differ from these by its temperatures' kind alone: 1021.8 to 1025.
    assert 1021.0 < water.densities[0] < 1022.5
    assert np.all(np.diff(water.densities) > 0.0)
    exact = gsw.rho_t_exact(SA, columns["temperature"], [10.0, 50.0, 125.0])
    np.testing.assert_allclose(water.densities, exact, rtol=2e-5)
    file = tmp_path / "cast.csv"
    file.write_text(
        "# a cast\nPressure [dbar]; Temp (degC); Psal\n10;28.8099;34.5487\nx;;\n50;28.4392;34.7275\n125;22.7862;34.8605\n"
    )
    again = lw.terms.DensityProfile.from_cast(file, latitude=4.0, longitude=188.0, compressibility=4e-6)
    np.testing.assert_array_equal(again.densities, water.densities)
    np.testing.assert_array_equal(again.depths, water.depths)
    assert again.compressibility == 4e-6


def test_a_cast_with_densities(tmp_path):
    file = tmp_path / "cast.txt"
    file.write_text("depth rho\n0 1000\n10 1010\n10 1012\n5 1004\n")
    water = lw.terms.DensityProfile.from_cast(file)
    np.testing.assert_array_equal(water.depths, [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(water.densities, [1000.0, 1004.0, 1011.0])
    xr = pytest.importorskip("xarray")
    data = xr.Dataset(
        {"rho": ("z", [1000.0, 1010.0], {"standard_name": "sea_water_density"})}, {"depth": ("z", [0.0, 10.0])}
    )
    data.to_netcdf(tmp_path / "cast.nc")
    np.testing.assert_array_equal(lw.terms.DensityProfile.from_cast(tmp_path / "cast.nc").densities, [1000.0, 1010.0])


def test_casts_that_are_refused(tmp_path):
    for columns, words in (
        ({"depth": [0.0, 1.0]}, "has no density"),
        ({"density": [1000.0]}, "has no depth"),
        ({"depth": [0.0, 1.0], "density": [1000.0]}, "differ in length"),
        ({"depths": [0.0, 1.0]}, "depths"),
        ({"depth": [np.nan], "density": [np.nan]}, "has no line"),
    ):
        with pytest.raises(lw.SceneError, match=words):
            lw.terms.DensityProfile.from_cast(**columns)
    with pytest.raises(lw.SceneError, match="is no file"):
        lw.terms.DensityProfile.from_cast(tmp_path / "none.csv")


def test_two_densities_are_refused():
    terms = (PROFILE, lw.terms.Stratification(gradient=1e-5))
    with pytest.raises(lw.SceneError, match=r"stratification.gradient.*beside a density_profile"):
        scene_of(Case(terms, ()))
    with pytest.raises(lw.SceneError, match=r"buoyancy_engine.gradient.*beside a density_profile"):
        scene_of(Case((PROFILE, lw.terms.BuoyancyEngine(**ENGINE)), ()))
    assert scene_of(Case((lw.terms.Ballast(),), ())).terms[0].profile is None
    assert VEHICLE.buoyancy == BUOYANCY
    assert STATE["b"][2] == 8.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("depth,density\n0,23.1\n20,25.2\n", "density = 23.1 is beyond 900 to 1500.*add 1,000"),
        ("depth,density [g/cm3]\n0,1.0231\n20,1.0252\n", "density = 1.0231 is beyond"),
        ("z,density\n-9,1025\n-1,1024\n0,1023\n", "depth = -9.0 is above the surface.*positive downward"),
        ("depth,density\n-999,1024\n10,1025\n", "depth = -999.0 is beyond"),
        ("depth,temp,sal\n0,10,35\n10,-999,35\n", "temperature = -999.0 is beyond -3 to 45.*deg C, and nan"),
        ("depth,temp,sal\n0,283.1,35\n10,282.1,35\n", "temperature = 283.1 is beyond"),
        ("depth,temp,sal\n0,10,0.035\n10,9,-9\n", "salinity = -9.0 is beyond"),
        ("pressure [Pa],temp,sal\n101325,10,35\n201325,9,35\n", "pressure = 101325.0 is beyond.*dbar"),
    ],
)
def test_casts_in_other_units_are_refused(tmp_path, text, words):
    file = tmp_path / "cast.csv"
    file.write_text(text)
    with pytest.raises(lw.SceneError, match=words):
        lw.terms.DensityProfile.from_cast(file)


def test_flags_and_marks_of_a_cast_are_no_numbers(tmp_path):
    # Flags before their columns, and Sea-Bird's mark for none.
    file = tmp_path / "cast.csv"
    file.write_text("depth_qc,depth,density_qc,rho_sd,density\n1,0,1,0.1,1023\n1,-9.990e-29,4,0,1030\n1,20,1,0,1025\n")
    water = lw.terms.DensityProfile.from_cast(file)
    np.testing.assert_array_equal(water.depths, [0.0, 20.0])
    np.testing.assert_array_equal(water.densities, [1023.0, 1025.0])


def test_a_cast_by_standard_names_or_its_own(tmp_path):
    # Floats of Argo have PRES as sea_water_pressure and PSAL as sea_water_salinity.
    xr, gsw = pytest.importorskip("xarray"), pytest.importorskip("gsw")
    columns = {
        "PRES": ("sea_water_pressure", [5.0, 50.0]),
        "PRES_QC": ("status_flag", [1.0, 1.0]),
        "TEMP": ("sea_water_temperature", [12.0, 8.0]),
        "PSAL": ("sea_water_salinity", [34.0, 35.0]),
    }
    data = xr.Dataset({name: ("n", value, {"standard_name": word}) for name, (word, value) in columns.items()})
    data.to_netcdf(tmp_path / "float.nc")
    water = lw.terms.DensityProfile.from_cast(tmp_path / "float.nc")
    np.testing.assert_allclose(water.depths, -gsw.z_from_p([5.0, 50.0], 0.0))
    # UNESCO's equation of state at 5 dbar, 34, 12 deg C: 1025.8; at 50 dbar, 35, 8 deg C: 1027.5.
    np.testing.assert_allclose(water.densities, [1025.8, 1027.5], atol=0.1)
