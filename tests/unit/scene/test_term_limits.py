# SPDX-License-Identifier: Apache-2.0
"""Numbers of terms that are too large to be meant: each has a rule, or says why it has none."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms import TYPES
from lgvi_warp.physics.terms import events as of_events
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.scene import plausibility, term_limits
from lgvi_warp.scene.term_limits import BY_NAME, BY_UNIT, Rule, rule_of
from tests.laws.cases import CASES
from tests.support.refusals import says

KINDS = {**{word: TYPES[word] for word in TYPES}, **{word: of_events.TYPES[word] for word in of_events.TYPES}}
SHIPPED = {word: kind for word, kind in KINDS.items() if kind.__module__.startswith("lgvi_warp.")}
BODY = {"mass": 30.0, "inertia": [0.2, 3.0, 3.0], "added_mass": [1.0, 30.0, 30.0], "buoyancy": 294.2}
WATER = 294.2 / 9.80665 / 1025.0
STATIONS = {"stations": [-0.8, 0.0, 0.8], "diameters": [0.1, 0.2, 0.1]}


@pytest.mark.parametrize("word", SHIPPED)
def test_every_number_has_a_rule_or_a_reason(word):
    for item in SHIPPED[word].number_fields():
        rule = rule_of(SHIPPED[word], item)
        assert isinstance(rule, Rule) or (isinstance(rule, str) and len(rule) > 10), (
            word,
            word_of(item),
            item.metadata["unit"],
        )


def test_no_rule_is_of_what_there_is_not():
    names = {f"{word}.{word_of(item)}" for word, kind in SHIPPED.items() for item in kind.number_fields()}
    units = {item.metadata["unit"] for kind in SHIPPED.values() for item in kind.number_fields()}
    assert set(BY_NAME) <= names
    # Units that extensions alone have stand there too: a law of somebody else may have them.
    assert set(BY_UNIT) - units <= {"m3", "m3/s", "kg", "1/m"}


def scene(**term):
    return lw.Scene.from_dict({"vehicle": BODY, "environment": {"water_density": 1025.0},
                               "start": {"position": [0.0, 0.0, 50.0]}, "terms": [term]})  # fmt: skip


def said(first):
    ensemble = first if isinstance(first, lw.Ensemble) else lw.Ensemble.from_scene(first)
    return plausibility.of_ensemble(ensemble).messages(ensemble.members)


def waves(a, T=(8.0,)):
    return scene(type="waves", amplitudes=a, periods=T, headings_deg=[0.0] * len(T))


K = (2.0 * np.pi / 8.0) ** 2 / 9.80665
HULL_VOLUME = np.pi / 4.0 * 0.8 * 2.0 * (0.01 + 0.02 + 0.04) / 3.0
# A scene of a number, what is usual, what is odd, and words of the message.
ODD = {
    "steep waves": (lambda a: waves([a]), 0.43 / K, 0.45 / K, "waves.amplitudes", "0.45", "break"),
    "steep sea": (lambda a: waves([a, a], (8.0, 8.0 + 1e-9)), 0.304 / K, 0.318 / K, "waves.amplitudes", "break"),
    "strips": (lambda f: scene(type="cross_flow", drag_coefficient=1.0, stations=[-0.8, 0.0, 0.8],
                               diameters=[0.1 * f, 0.2 * f, 0.1 * f]),
               (2.9 * WATER / HULL_VOLUME) ** 0.5, (10.0 * WATER / HULL_VOLUME) ** 0.5, "cross_flow.diameters", "10 times"),
    "added mass": (lambda a: scene(type="hull_loads", **STATIONS, added_mass=[a, a, a]), 2.9 * 30.0 / 1.6, 20.0 * 30.0 / 1.6,
                   "hull_loads.added_mass", "20 times its added mass across"),
    "arm": (lambda x: scene(type="fins", position=[[x, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 1.0, 0.0]],
                            area=[0.01], lift_slope=[3.0], drag=[0.02]), -0.7, -700.0, "fins.position", "700 m", "mm"),
    "area": (lambda A: scene(type="fins", position=[[-0.7, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 1.0, 0.0]],
                             area=[A], lift_slope=[3.0], drag=[0.02]), 0.01, 100.0, "fins.area", "100 m2"),
    "slope": (lambda s: scene(type="fins", position=[[-0.7, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 1.0, 0.0]],
                              area=[0.01], lift_slope=[s], drag=[0.02]), 6.3, 360.0, "fins.lift_slope", "thin wings"),
    "force": (lambda F: scene(type="wrench", force=[F, 0.0, 0.0]), 29000.0, 30000.0, "wrench.force", "weight"),
    "torque": (lambda N: scene(type="wrench", torque=[0.0, 0.0, N]), 41000.0, 42000.0, "wrench.torque", "weight and length"),
    "hotel": (lambda P: scene(type="energy_use", hotel=P), 500.0, 2e6, "energy_use.hotel", "W"),
    "drag": (lambda C: scene(type="cross_flow", **STATIONS, drag_coefficient=C), 1.1, 110.0, "cross_flow.drag_coefficient"),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_beyond_a_rule_is_said_and_at_it_is_not(name):
    beyond_is_said(*ODD[name])


def beyond_is_said(make, usual, odd, *words):
    """A number at its rule is not said, one beyond it is, in these words."""
    assert said(make(usual)) == ()
    texts = said(make(odd))
    assert len(texts) == 1, texts
    says(texts[0], *words)


def test_members_are_counted():
    fleet = lw.Ensemble(
        waves([1.0]), 100, 1, {"waves.amplitudes[0]": lw.distributions.Uniform(low=0.0, high=2.0 * 0.44 / K)}
    )
    (text,) = said(fleet)
    steep = fleet.parameters(0, 100)["waves.amplitudes"][:, 0] * K > 0.44
    says(text, f"({steep.sum()} of 100 members; first: member {steep.argmax()})")


def test_vehicles_without_weight_are_not_odd():
    weightless = lw.Scene.from_dict({"vehicle": BODY | {"buoyancy": 0.0}, "environment": {"gravity": 0.0},
                                     "terms": [{"type": "wrench", "force": [1e6, 0.0, 0.0]}]})  # fmt: skip
    assert said(weightless) == ()


ODD_CASES = {"stratification of a hull that yields", "all together"}


def test_terms_of_the_tests_are_usual():
    """In a long hull; but for one that yields by 2 % a metre, to be seen, and for all terms at once."""
    for name, case in CASES.items():
        checked = lw.Scene(
            lw.Vehicle(**BODY | {"inertia": [20.0, 300.0, 300.0]}),
            terms=list(case.terms),
            start=lw.Start([0.0, 0.0, 50.0]),
        )
        found = [text for text in said(checked) if text.partition(":")[0] in {
            f"{term.key}.{word_of(item)}" for term in case.terms for item in term.number_fields()
            if isinstance(rule_of(type(term), item), term_limits.Rule)}]  # fmt: skip
        assert (found == []) == (name not in ODD_CASES), (name, found)


def beside(*currents, headings=(0.0,), periods=(4.0,)):
    """Waves of 5 cm in the sea of these currents."""
    sea = {
        "type": "waves",
        "amplitudes": [0.05] * len(periods),
        "periods": list(periods),
        "headings_deg": list(headings),
    }
    return lw.Scene.from_dict({"vehicle": BODY, "start": {"position": [0.0, 0.0, 50.0]}, "terms": [sea, *currents]})


def flow(*velocity):
    return {"type": "current", "velocity": list(velocity)}


def profile(*velocity):
    """A current that may vary with depth, and does not."""
    return {"type": "current_profile", "depths": [0.0, 9.0], "velocities": [list(velocity)] * 2}


@pytest.mark.parametrize(
    ("currents", "ratio"),
    [
        ([profile(1.0, 0.0, 0.0)], 1.0),
        ([profile(-1.0, 0.0, 0.0)], -1.0),
        ([profile(0.6, 4.0, 0.0)], 0.6),
        ([{"type": "current_profile", "depths": [0.0, 9.0], "velocities": [[0.2, 0.0, 0.0], [-0.5, 0.0, 0.0]]}], -0.5),
        (
            [
                {"type": "current_harmonics", "amplitudes": [[0.3, 0.0, 0.0]], "periods": [900.0]},
                profile(0.1, 0.0, 0.0),
            ],
            0.4,
        ),
    ],
)
def test_waves_beside_a_current_that_varies_have_no_doppler_shift(currents, ratio):
    """By k U / omega: the orbit of water that moves along is 1 / (1 - k U / omega) times that of waves in its frame."""
    share = ratio * 2.0 * np.pi / 4.0 / 9.80665
    (text,) = said(beside(*currents))
    says(
        text,
        "waves.periods",
        "not shifted (Doppler)",
        f"{share:.2g}",
        f"{100.0 * (1.0 / (1.0 - share) - 1.0):+.2g} %",
    )


def test_currents_across_waves_and_still_water_shift_nothing():
    assert said(beside()) == ()
    assert said(beside(profile(0.0, 1.0, 0.0))) == ()
    assert said(beside(profile(0.0, 0.0, 0.0))) == ()
    vary = {"current_profile.velocities[0,0]": lw.distributions.Uniform(low=-1.0, high=1.0)}
    fleet = lw.Ensemble(beside(profile(0.1, 0.0, 0.0)), 50, 1, vary)
    assert "50 of 50" in said(fleet)[0] or "all 50" in said(fleet)[0]


def test_a_uniform_current_shifts_waves_and_nothing_is_said_until_it_blocks_them():
    """4 s waves against a current are blocked where 4 U omega / g > 1: beyond 1.56 m/s."""
    assert said(beside(flow(1.0, 0.0, 0.0))) == said(beside(flow(-1.5, 0.0, 0.0))) == ()
    (text,) = said(beside(flow(-1.6, 0.0, 0.0)))
    says(text, "waves.periods", "1 of the waves cannot travel against the current")
    vary = {"current.velocity[0]": lw.distributions.Choice([-1.0, -1.7])}
    (text,) = said(lw.Ensemble(beside(flow(0.0, 0.0, 0.0)), 50, 1, vary))
    says(text, "waves.periods", "of 50 members")


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("U", [1.0, -1.0])
def test_the_percentage_is_that_of_a_run(U):
    """A neutral sphere that moves with the water at 3 m of depth: the radius of its orbit over a exp(-k z)."""
    a, w = 0.05, 2.0 * np.pi / 4.0
    k = w * w / 9.80665
    body = {"mass": 10.0, "inertia": [0.1] * 3, "added_mass": [5.0] * 3, "buoyancy": 98.0665}
    start = {"position": [0.0, 0.0, 3.0], "velocity": [U + a * w * np.exp(-3.0 * k), 0.0, 0.0]}
    scene = beside(profile(U, 0.0, 0.0))
    moving = lw.Scene.from_dict(scene.to_dict() | {"vehicle": body, "start": start})
    z = lw.solve(moving, "rk4", h=0.02, t1=40.0, save=lw.SaveAt(every=0.1)).position[:, 0, 2]
    radius = np.ptp(z) / 2.0 / a / np.exp(-3.0 * k)
    assert radius == pytest.approx(1.0 / (1.0 - k * U / w), rel=0.02)
