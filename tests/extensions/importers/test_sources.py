# SPDX-License-Identifier: Apache-2.0
"""The vehicles that others have modelled: their files against what the importer makes of the sources' numbers."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.vehicles.fossen import vehicle_tables

EYE_LESS = {"cog": [0.0, 0.0, 0.0], "gravity": 9.81}
# As uuv_simulator's files print them: centres and inertia z up, matrices of the water z down, derivatives by their sign.
REXROV = EYE_LESS | {
    "mass": 1862.87, "volume": 1.83826, "density": 1028.0, "cob": [0.0, 0.0, 0.3],
    "inertial": {"ixx": 525.39, "ixy": 1.44, "ixz": 33.41, "iyy": 794.20, "iyz": 2.6, "izz": 691.23},
    "Ma": [[779.79, -6.8773, -103.32, 8.5426, -165.54, -7.8033], [-6.8773, 1222, 51.29, 409.44, -5.8488, 62.726],
           [-103.32, 51.29, 3659.9, 6.1112, -386.42, 10.774], [8.5426, 409.44, 6.1112, 534.9, -10.027, 21.019],
           [-165.54, -5.8488, -386.42, -10.027, 842.69, -1.1162], [-7.8033, 62.726, 10.775, 21.019, -1.1162, 224.32]],
    "linear_damping": [-74.82, -69.48, -728.4, -268.8, -309.77, -105],
    "quad_damping": [-748.22, -992.53, -1821.01, -672, -774.44, -523.27],
}  # fmt: skip
A9 = EYE_LESS | {
    "mass": 69.7, "volume": 0.06799987704121499, "density": 1027.0, "cob": [0.0, 0.0, 0.06],
    "inertial": [0.6, 30.0, 35.0], "Ma": [4, 95, 75, 0.4, 27, 32],
    "linear_damping_forward_speed": [
        [-8, 0, 0, 0, 0, 0], [0, -162, 0, 0, 0, 150], [0, 0, -108, 0, -100, 0], [0, 0, 0, -13, 0, 0],
        [0, 0, 37, 0, -20, 0], [0, -34, 0, 0, 0, -32]],
}  # fmt: skip
CYLINDER = 18.0 * (3.0 * 0.075**2 + 1.08**2) / 12.0
LAUV = EYE_LESS | {
    "mass": 18.0, "volume": 0.017551374956865266, "density": 1028.0, "cob": [0.0, 0.0, 0.01],
    "inertial": [0.5 * 18.0 * 0.075**2, CYLINDER, CYLINDER], "Ma": [1, 16, 16, 0.005, 1.3, 1.3],
    "linear_damping": [
        [-2.4, 0, 0, 0, 0, 0], [0, -23, 0, 0, 0, 11.5], [0, 0, -23, 0, -11.5, 0], [0, 0, 0, -0.3, 0, 0],
        [0, 0, 3.1, 0, -9.7, 0], [0, -3.1, 0, 0, 0, -9.7]],
    "quadratic_damping": [
        [-2.4, 0, 0, 0, 0, 0], [0, -80, 0, 0, 0, 0.3], [0, 0, -80, 0, -0.3, 0], [0, 0, 0, -0.0006, 0, 0],
        [0, 0, 1.5, 0, -9.1, 0], [0, -1.5, 0, 0, 0, -9.1]],
}  # fmt: skip
HULL = ("drag", "drag_matrix", "body_lift")


@pytest.mark.parametrize(("name", "source"), [("lauv", LAUV), ("rexrov", REXROV), ("eca_a9", A9)])
def test_the_importer_makes_the_file_of_the_source_s_numbers(name, source):
    """uuv_simulator's conventions, turned by the importer: z up to z down, derivatives to magnitudes, volume to newtons."""
    yaml = pytest.importorskip("yaml")
    quadratic = "full" if name == "lauv" else "diagonal"
    made = lw.vehicles.from_yaml(yaml.safe_dump(source), quadratic=quadratic)
    given = vehicle_tables(name)
    for key in ("rigid_body_mass_matrix", "added_mass_matrix", "weight", "buoyancy", "center_of_buoyancy"):
        np.testing.assert_allclose(given["vehicle"][key], made["vehicle"][key], rtol=1e-13, atol=1e-15, err_msg=key)
    assert given["environment"] == made["environment"]
    (law,) = made["terms"]
    (own,) = [t for t in given["terms"] if t["type"] in HULL]
    assert own["type"] == law["type"]
    for key in set(law) - {"type"}:
        np.testing.assert_allclose(own[key], law[key], rtol=1e-15, err_msg=key)
