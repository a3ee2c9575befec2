# SPDX-License-Identifier: Apache-2.0
"""Members that rise above the surface without a term or event for it are counted, whatever a run saves."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Warnings
from lgvi_warp.engine import plan
from lgvi_warp.scene.plausibility import LIMITS

SEA = lw.terms.Waves(amplitudes=[0.6, 0.2], periods=[6.0, 4.0], headings_deg=[0.0, 40.0])
STEP, END = 0.02, 12.0
HEIGHT = LIMITS["height"].value


def fleet_in(*terms, depth=0.4, events=(), members=60):
    """Neutral spheres, which follow the water up and down, each at its own depth in its own sea."""
    body = lw.Vehicle(mass=10.0, inertia=[0.1] * 3, added_mass=[5.0] * 3, buoyancy=98.0665)
    scene = lw.Scene(body, terms=[SEA, *terms], events=list(events), start=lw.Start([0.0, 0.0, depth]))
    vary = {
        "waves.phases": lw.distributions.Uniform(low=0.0, high=6.283),
        "start.position[2]": lw.distributions.Uniform(low=0.0, high=2.0 * depth),
    }
    return lw.Ensemble(scene, members, 1, vary)


def counted(result):
    return np.flatnonzero(result.warnings.has(Warnings.ABOVE_SURFACE))


@pytest.fixture(scope="module")
def truth():
    """The greatest height of each member, by its depth after every step."""
    return -lw.solve(fleet_in(), "rk4", h=STEP, t1=END, save=lw.SaveAt(every=STEP)).position[..., 2].min(axis=0)


WAYS = {
    "samples": {"save": lw.SaveAt(every=0.5)},
    "no samples": {"save": lw.SaveAt()},
    "another field": {"save": lw.SaveAt(fields=["velocity"])},
    "statistics": {"statistics": [lw.statistics.Mean("speed")], "keep": "none"},
    "store": {"save": lw.SaveAt(every=3.0)},
    "one process more": {"save": lw.SaveAt(), "executor": "processes", "threads": 2},
}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(
    "way", [w if w != "one process more" else pytest.param(w, marks=pytest.mark.slow) for w in WAYS]
)
def test_members_above_the_surface_are_counted(way, truth, tmp_path):
    """Looks between which a wave turns by an eighth of its period see all but a tenth of a height."""
    more = {"store": tmp_path / "run.zarr"} if way == "store" else {}
    result = lw.solve(fleet_in(), "rk4", h=STEP, t1=END, **WAYS[way], **more)
    found = set(counted(result))
    assert 0 < len(found) < 60
    assert found <= set(np.flatnonzero(truth > HEIGHT))
    assert found >= set(np.flatnonzero(truth > HEIGHT + 0.1))
    (text,) = (text for text in result.messages if text.startswith("position:"))
    assert f"{len(found)} of 60 members rise above the surface" in text
    assert "lw.events.Surface()" in text
    heights = result.warning_value[sorted(found)]
    assert (heights <= truth[sorted(found)] + 1e-9).all()
    assert heights.max() > truth.max() - 0.1


@pytest.mark.ci
@pytest.mark.kernel
def test_looks_depend_on_no_launch_and_change_no_bit(monkeypatch):
    """Members in blocks of their own, a run in two parts, and one without looks between launches."""
    fleet = fleet_in()
    save = lw.SaveAt(final=True)
    whole = lw.solve(fleet, "rk4", h=STEP, t1=END, save=save)
    for indices in ([3], [5, 17, 41]):
        part = lw.solve(fleet.subset(indices), "rk4", h=STEP, t1=END, save=save)
        for name in ("warnings", "warning_time", "warning_value"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[indices])
    first = lw.solve(fleet, "rk4", h=STEP, t1=0.25 * END, save=save)
    second = lw.solve(fleet, "rk4", h=STEP, t1=END, start=first.final, save=save)
    assert set(counted(first)) < set(counted(whole))
    for name in ("warnings", "warning_time", "warning_value"):
        np.testing.assert_array_equal(getattr(second, name), getattr(whole, name))
    monkeypatch.setattr(plan, "time_between_looks", lambda scene: None)
    without = lw.solve(fleet, "rk4", h=STEP, t1=END, save=save)
    np.testing.assert_array_equal(without.position, whole.position)
    assert len(counted(without)) < len(counted(whole))


@pytest.mark.ci
@pytest.mark.kernel
def test_without_waves_members_that_end_above_are_counted_by_any_way():
    """A sphere lighter than water in linear drag rises at a known speed; one member is heavier and sinks."""
    body = lw.Vehicle(mass=10.0, inertia=[0.1] * 3, buoyancy=108.0665)
    scene = lw.Scene(body, terms=[lw.terms.Drag(linear=[20.0] * 6)], start=lw.Start([0.0, 0.0, 1.0]))
    still = np.tile([0.0, 0.0, 1.0], (3, 1)), np.tile(np.eye(3), (3, 1, 1)), np.zeros((3, 3)), np.zeros((3, 3))
    rising = lw.Ensemble.from_states(scene, *still, {"vehicle.buoyancy": np.array([108.0665, 88.0, 108.0665])})
    for way in ("samples", "no samples", "another field"):
        result = lw.solve(rising, "rk4", h=STEP, t1=END, **WAYS[way])
        assert counted(result).tolist() == [0, 2]
        # After 0.5 s at 0.5 m/s, from 1 m: 10 N over 20 N s/m.
        assert result.warning_value[0] == pytest.approx(0.5 * (END - 0.5) - 1.0, abs=0.01)


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("way", ["event", "term", "box"])
def test_a_scene_that_knows_its_surface_counts_none(way):
    more = {
        "event": {"events": [lw.events.Surface()]},
        "box": {"events": [lw.events.Box(lower=[-99.0, -99.0, 0.0], upper=[99.0] * 3)]},
        "term": {"terms": [lw.terms.SurfaceBuoyancy(heights=0.3)]},
    }[way]
    fleet = fleet_in(*more.get("terms", ()), events=more.get("events", ()), members=8)
    result = lw.solve(fleet, "psi_s", h=STEP, t1=2.0)
    assert not counted(result).size
    assert not any("above the surface" in text for text in result.messages)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_start_at_the_surface_counts_and_one_above_it_is_told_of_by_itself():
    """Members at the surface, at the default start, and above it."""
    fleet = fleet_in(members=3)
    at = dataclasses.replace(fleet.scene, start=lw.Start(velocity=[0.0, 0.0, -2.0]))
    assert counted(lw.solve(at, "rk4", h=STEP, t1=2.0)).tolist() == [0]
    above = dataclasses.replace(at, start=lw.Start([0.0, 0.0, -1.0]))
    result = lw.solve(above, "rk4", h=STEP, t1=2.0)
    assert not counted(result).size
    assert any(text.startswith("start.position") for text in result.messages)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_moved_origin_is_undone():
    """The user's origin, though the method's is that of the mass: a hull whose origin is 2 m above its centre."""
    body = lw.Vehicle(
        rigid_body_mass_matrix=moved(2.0),
        buoyancy=98.0665,
        center_of_buoyancy=[0.0, 0.0, 2.0],
        center_of_gravity=[0.0, 0.0, 2.0],
    )
    depths = {}
    for depth in (0.5, -0.5 + 2.0):
        scene = lw.Scene(body, start=lw.Start([0.0, 0.0, depth], velocity=[0.0, 0.0, -0.5]))
        result = lw.solve(scene, "psi_s", h=STEP, t1=2.0, save=lw.SaveAt(fields=["velocity"]))
        depths[depth] = counted(result).size
    assert depths == {0.5: 1, 1.5: 0}


def moved(z):
    """The mass matrix of a body of 10 kg whose centre is z [m] below the origin."""
    offset = np.array([[0.0, -z, 0.0], [z, 0.0, 0.0], [0.0, 0.0, 0.0]])
    inertia = 0.1 * np.eye(3) - 10.0 * offset @ offset
    return np.block([[10.0 * np.eye(3), -10.0 * offset], [10.0 * offset, inertia]])
