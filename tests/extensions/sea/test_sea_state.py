# SPDX-License-Identifier: Apache-2.0
"""Random seas against the spectra, heights and spreads that they are drawn from, and the same seas however they are run."""

import numpy as np
import pytest
from scipy import integrate

import lgvi_warp as lw
from lgvi_warp.physics.terms.base import own
from lgvi_warp.scene import plausibility

# A chance of 6e-5 for a right code; the seeds are fixed: a failure means a changed law.
ERRORS = 4.0
SEAS = 100_000
HS, TP = 1.7, 7.0
FORECAST = dict(significant_height=HS, peak_period=TP, heading_deg=40.0)


def scene_in(start=(0.0, 0.0, 12.0), **numbers):
    """A vehicle in a sea."""
    sea = lw.terms.SeaState(**FORECAST | numbers)
    return lw.Scene.named("sphere", terms=[sea], start={"position": list(start)})


def drawn(members=SEAS, vary=None, **numbers):
    """The sea of a scene, its numbers, and those of the scene, for so many members."""
    fleet = lw.Ensemble(scene_in(**numbers), members, 3, vary)
    sea, p = fleet.scene.terms[-1], fleet.parameters(0, members)
    return sea, own(sea, p), p


def jonswap(f, gamma, tp=TP):
    """The shape of the spectrum as printed, without its constant (Hasselmann et al. 1973)."""
    sigma = 0.07 if f <= 1.0 / tp else 0.09
    return f**-5.0 * np.exp(-1.25 * (f * tp) ** -4.0) * gamma ** np.exp(-((f * tp - 1.0) ** 2) / (2.0 * sigma**2))


@pytest.mark.ci
@pytest.mark.parametrize("amplitudes", ["equal", "rayleigh"])
def test_significant_height_of_the_surface(amplitudes):
    # One sample of each of 1e5 seas. Of n independent waves <eta^4> = 3 m0^2 (1 - 1 / 2n); of Rayleigh's eta is normal.
    sea, numbers, p = drawn(amplitudes=amplitudes, spreading=5.0)
    place = np.broadcast_to([31.0, -17.0, 0.0], (1, SEAS, 3))
    eta = sea.elevation(numbers, place, np.array([1234.5]), p)[0]
    error = HS / 2.0 * np.sqrt((2.0 - 1.5 / 20 * (amplitudes == "equal")) / SEAS)
    assert abs(4.0 * np.sqrt(np.mean(eta**2)) - HS) < ERRORS * error
    assert abs(np.mean(eta)) < ERRORS * HS / 4.0 / np.sqrt(SEAS)


def test_equal_amplitudes_give_every_member_its_height():
    vary = {"sea_state.significant_height": lw.distributions.Uniform(low=0.5, high=2.0)}
    sea, numbers, p = drawn(50, vary)
    energy = 0.5 * np.sum(sea.wave_table(numbers, p).amplitude ** 2, axis=1)
    np.testing.assert_allclose(4.0 * np.sqrt(energy), p["sea_state.significant_height"], rtol=1e-14)


@pytest.mark.parametrize(("spectrum", "gamma"), [("jonswap", 3.3), ("jonswap", 7.0), ("pierson_moskowitz", 1.0)])
def test_frequencies_are_those_of_the_spectrum(spectrum, gamma):
    # Waves of equal energy: their frequencies have the spectrum's density, peak and distribution, cut at 3 / Tp.
    peaked = {"peakedness": gamma} if spectrum == "jonswap" else {}
    sea, numbers, p = drawn(20_000, spectrum=spectrum, **peaked)
    f = np.sort(sea.wave_table(numbers, p).omega.ravel()) / (2.0 * np.pi)
    assert 3.0 / TP - 0.01 < f[-1] < 3.0 / TP
    counts, edges = np.histogram(f, 150, (0.5 / TP, 1.5 / TP))
    # The peak of a fully grown sea is so flat that neighbours of its bin have counts that differ by chance alone.
    assert abs(edges[counts.argmax()] + 0.5 * (edges[1] - edges[0]) - 1.0 / TP) < (0.05 if gamma == 1.0 else 0.01) / TP
    total = integrate.quad(jonswap, 1e-3, 3.0 / TP, (gamma,), points=[1.0 / TP], limit=400)[0]
    for at in np.array([0.7, 0.9, 1.0, 1.1, 1.4, 2.0, 2.7]) / TP:
        part = integrate.quad(jonswap, 1e-3, at, (gamma,), points=[min(at, 1.0 / TP)], limit=400)[0] / total
        # In one share of the energy of a wave: 20,000 members are below or above. The table is good to 1e-5.
        assert abs(np.mean(f < at) - part) < ERRORS * 0.5 / 20 / np.sqrt(20_000) + 1e-5
        assert float(sea.density(at)) == pytest.approx(HS**2 / 16.0 * jonswap(at, gamma) / total, rel=1e-4)


def test_directions_are_spread_as_asked():
    # cos^2s of half the angle: <cos> = s / (s + 1), <cos 2> = s (s - 1) / ((s + 1) (s + 2)) (Longuet-Higgins et al. 1963).
    for s in (0.0, 1.0, 8.0, 75.0):
        sea, numbers, _ = drawn(20_000, spreading=s)
        angle = sea.sea(numbers)[2].ravel() - np.radians(40.0)
        error = ERRORS / np.sqrt(2.0 * angle.size)
        assert abs(np.mean(np.cos(angle)) - s / (s + 1.0)) < error
        assert abs(np.mean(np.cos(2.0 * angle)) - s * (s - 1.0) / ((s + 1.0) * (s + 2.0))) < error
        assert abs(np.mean(np.sin(angle))) < error
    sea, numbers, _ = drawn(3)
    assert np.all(sea.sea(numbers)[2] == np.radians(40.0))


def test_a_record_does_not_repeat():
    sea, numbers, p = drawn(1)
    time = np.arange(0.0, 7200.0, 0.5)
    eta = sea.elevation(numbers, np.zeros((len(time), 1, 3)), time, p)[:, 0]
    first = eta[:400] / np.linalg.norm(eta[:400])
    windows = np.lib.stride_tricks.sliding_window_view(eta, 400)[200:]
    assert (windows @ first / np.linalg.norm(windows, axis=1)).max() < 0.9


def test_seas_of_members():
    # Of its own by default; by its seed the same for all; as given where levels are.
    own_seas = lw.Ensemble(scene_in(), 4, 3).parameters(0, 4)["sea_state.levels"]
    assert len(np.unique(own_seas)) == own_seas.size == 4 * 20 * 2
    shared = lw.Ensemble(scene_in(seed=7), 4, 3)
    assert not shared.vary
    assert shared.parameters(0, 4)["sea_state.levels"].shape == (1, 20, 2)
    assert np.any(shared.scene.terms[-1].parameters()["levels"] != scene_in(seed=8).terms[-1].parameters()["levels"])
    given = scene_in(components=3, levels=np.full((3, 2), 0.5))
    assert np.all(lw.Ensemble(given, 4).parameters(0, 4)["sea_state.levels"] == 0.5)
    one = {"sea_state.levels": np.full((4, 20, 2), 0.25)}
    assert np.all(lw.Ensemble(scene_in(), sampling=lw.designs.Table(one)).parameters(0, 4)["sea_state.levels"] == 0.25)


def test_a_sea_depends_on_seed_and_member_alone():
    vary = {
        "sea_state.peakedness": lw.distributions.Uniform(low=1.0, high=6.0),
        "sea_state.peak_period": lw.distributions.Normal(std=0.5),
        "sea_state.heading_deg": lw.distributions.Normal(std=20.0),
    }
    fleet = lw.Ensemble(scene_in(spreading=9.0, depth=20.0), 300, 5, vary)
    sea, p = fleet.scene.terms[-1], fleet.parameters(0, 300)
    whole = sea.wave_table(own(sea, p), p)
    for members in ([0], [299, 3, 17], list(range(100, 200))):
        q = fleet.subset(members).parameters(0, len(members))
        for table, some in zip(whole, sea.wave_table(own(sea, q), q), strict=True):
            np.testing.assert_array_equal(some, table[members])
    assert np.any(fleet.with_seed(6).parameters(0, 1)["sea_state.levels"] != p["sea_state.levels"][:1])
    again = lw.Ensemble(fleet.scene, 300, 5, lw.Scene.from_dict(
        fleet.scene.to_dict() | {"ensemble": fleet.to_dict()}).ensemble_settings.vary)  # fmt: skip
    np.testing.assert_array_equal(again.parameters(0, 300)["sea_state.levels"], p["sea_state.levels"])


def test_a_sea_is_one_factor_of_a_design():
    vary = {"vehicle.mass": lw.distributions.Normal(std=0.1)}
    fleet = lw.Ensemble(scene_in(), None, 1, vary, "saltelli")
    assert [label for label, _ in fleet.space.factors] == ["sea_state.levels", "vehicle.mass"]


@pytest.mark.slow
@pytest.mark.kernel
def test_same_bits_for_any_threads_and_subset():
    fleet = lw.Ensemble(scene_in(spreading=6.0), 700, 2)

    def run(fleet, **named):
        return lw.solve(fleet, "rk4", h=0.05, t1=2.0, **named).position

    whole = run(fleet, threads=1)
    np.testing.assert_array_equal(run(fleet, threads=3), whole)
    np.testing.assert_array_equal(run(fleet.subset([5, 699, 6])), whole[:, [5, 699, 6]])
    assert len(np.unique(whole[-1, :, 0])) == 700


def oddities(scene):
    """Texts of `plausibility` on the waves of a scene."""
    ensemble = scene if isinstance(scene, lw.Ensemble) else lw.Ensemble.from_scene(scene)
    return [text for text in plausibility.of_ensemble(ensemble).messages(ensemble.members) if "sea_state" in text]


def test_impossible_seas_are_flagged_by_member():
    # A wave of 3 s is 14.05 m long in deep water: no sea of 3 s is higher than 2.0 m.
    assert oddities(scene_in(significant_height=2.0, peak_period=3.0)) == []
    (text,) = oddities(scene_in(significant_height=2.01, peak_period=3.0))
    assert text.startswith("sea_state.significant_height")
    assert "0.143" in text
    vary = {"sea_state.peak_period": lw.distributions.Choice([2.0, 9.0])}
    (text,) = oddities(lw.Ensemble(scene_in(), 100, 1, vary))
    assert "of 100 members" in text


def test_numbers_that_are_no_sea_are_refused():
    faults = {
        "significant_height": -1.0, "peak_period": 0.0, "peakedness": 0.5, "spreading": -1.0, "components": 0, "seed": -1,
        "spectrum": "jonswop", "depth": 0.0, "levels": [[0.5, 1.5]] * 20,
    }  # fmt: skip
    for name, value in faults.items():
        with pytest.raises(lw.SceneError, match=f"sea_state.{name}"):
            lw.terms.SeaState(**FORECAST | {name: value})
    with pytest.raises(lw.SceneError, match="levels"):
        lw.terms.SeaState(**FORECAST, components=5, levels=np.full((5, 3), 0.5))
