# SPDX-License-Identifier: Apache-2.0
"""The scene files of examples/scenes load and run as they stand: an autopilot with sensors, and a thruster that dies."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT

FIELDS = ("position", "command", "actuator", "unmet", "measured_depth")


def solved(name, duration, **overrides):
    """The result of a scene file, which is that of its own tables as well."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / f"{name}.toml", {"run.duration": duration} | overrides)
    save = lw.SaveAt(every=0.5, fields=FIELDS)
    result, again = lw.solve(scene, save=save), lw.solve(lw.Scene.from_dict(scene.to_dict()), save=save)
    assert all(np.array_equal(getattr(result, field), getattr(again, field)) for field in FIELDS)
    assert result.status.counts() == {"ok": len(result.status)}
    return result


@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_a_scene_file_is_its_own_tables(path):
    scene = lw.Scene.load(path)
    again = lw.Scene.from_dict(scene.to_dict())
    assert again.to_dict() == scene.to_dict()
    assert {name: value.tolist() for name, value in again.parameters().items()} == {
        name: value.tolist() for name, value in scene.parameters().items()
    }


@pytest.mark.slow
def test_remus_dives_by_what_its_sensors_say_and_its_rudder_sticks():
    result = solved("remus_100_autopilot", 42.0, **{"ensemble.members": 8})
    rudder, depth = result.command[:, :, 0], result.position[:, :, 2]
    # Stuck from 40 s on at its offset [rad], at the actuator a delay of 0.02 s later.
    stuck = result.time >= 40.0
    assert np.all(rudder[stuck] == 0.1)
    assert not np.any(rudder[~stuck] == 0.1)
    assert np.all(result.actuator[result.time >= 40.5, :, 0] == 0.1)
    # The reference model has gone 0.986 of the way from 0 to 10 m at 40 s: 8 / s of its frequency.
    assert np.all(np.abs(depth[result.time == 40.0] - 10.0) < 1.0)
    # Readings are whole numbers of the quantum of 0.005 m, and differ from the truth by noise.
    readings = result.measured_depth / 0.005
    assert np.abs(readings - np.round(readings)).max() < 1e-9
    # About each member's bias they have the noise of 0.02 m and the quantum; n numbers know it to 1 / sqrt(2 n), times five.
    off = result.measured_depth - depth
    noise = (off - off.mean(axis=0)).std(ddof=1)
    assert abs(noise / np.hypot(0.02, 0.005 / np.sqrt(12.0)) - 1.0) < 5.0 / np.sqrt(2.0 * off.size)


@pytest.mark.slow
def test_bluerov2_holds_its_place_though_a_thruster_dies():
    result = solved("bluerov2_dead_thruster", 30.0)
    dead = result.time >= 20.0
    assert np.all(result.command[dead, 0, 4] == 0.0)
    assert np.all(result.command[(result.time > 0.0) & ~dead, 0, 4] != 0.0)
    # A second is 35 of the thrusters' time constants.
    assert np.abs(result.actuator[result.time >= 21.0, 0, 4]).max() < 1e-12
    # Its integral takes it beyond the place, as is usual of one that starts 5 m off; from then on it stays.
    assert np.linalg.norm(result.position[result.time >= 10.0, 0] - (0.0, 0.0, 5.0), axis=1).max() < 1.0
