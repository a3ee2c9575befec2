# SPDX-License-Identifier: Apache-2.0
"""Noise on a grid of its own: steps that divide one another see one path, whose numbers are those of exact solutions."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, div, mul, normals_over, ones, root  # noqa: F401
from lgvi_warp.checks.bench import KICK, STEP, Bank, Bench
from lgvi_warp.measuring.comparison import Sample, drawn_every
from lgvi_warp.physics import terms
from lgvi_warp.reference.random import draws_of_step, normals
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.wrench_noise import WrenchNoise
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import GRAVITY, slope, vehicle

# A chance of 6e-7 for a right code; the seeds are fixed: a failure means a changed law.
ERRORS = 5.0
MEMBERS = 4096
# A neutral body that does not turn: each axis is v' = -RATE v + S / MASS dw.
MASS, DRAG, SPEED = 2.0, 1.0, np.array((1.0, -0.5, 0.3))
RATE = DRAG / MASS
S = np.array((0.5, 0.8, 0.3))
GRID, END = 0.025, 2.0
REPEATS = (1, 2, 4, 8)
WANDER = {"standard_deviation": (0.3, 0.2, 0.05), "time_constant": 1.5}
# Too weak to be seen: the tests of this file share a kernel.
WEAK = {"standard_deviation": (1e-30,) * 3, "time_constant": 1.0}


def fleet(wander=WEAK, force=S, members=MEMBERS, seed=7, grid=GRID):
    """Members of one start under linear drag, white noise and a current that wanders, both drawn on a grid."""
    noise = [terms.WrenchNoise(force=force, noise_step=grid), terms.GaussMarkovCurrent(**wander, noise_step=grid)]
    drag = terms.DragMatrix(linear=np.diag([DRAG] * 3 + [1e-30] * 3))
    body = vehicle(M=(MASS,) * 3, J=(1e9, 2e9, 3e9))
    scene = lw.Scene(body, lw.Environment(GRAVITY), terms=[drag, *noise], start=lw.Start(velocity=SPEED))
    return lw.Ensemble(scene, members, seed)


def run(h, t1=END, method="psi_x", every=None, **named):
    return lw.solve(fleet(**named), method, h=h, t1=t1, save=every and lw.SaveAt(every=every))


@pytest.mark.ci
@pytest.mark.parametrize("repeat", REPEATS)
def test_white_noise_on_linear_drag_is_its_own_recursion(repeat):
    # A step of psi_x: half the impulse, the implicit step V (Alexander 1977: its factor of y' = -g y), half the impulse.
    members, h = 5, repeat * GRID
    result = run(h, every=0.2, members=members)
    channel = terms.noisy.channel("wrench_noise")
    draws = normals(7, 0, np.arange(members), np.arange(round(END / GRID))[:, None], channel)[..., :3]
    impulses = np.sqrt(GRID) * S / MASS * draws.reshape(-1, repeat, members, 3).sum(axis=1)
    v, gamma = np.broadcast_to(SPEED, (members, 3)), 1.0 - 0.5**0.5
    decay = (1.0 - (1.0 - 2.0 * gamma) * RATE * h) / (1.0 + gamma * RATE * h) ** 2
    for impulse in impulses:
        v = (v + 0.5 * impulse) * decay + 0.5 * impulse
    np.testing.assert_allclose(result.velocity[-1], v, rtol=0.0, atol=1e-13)


@pytest.mark.ci
def test_the_current_that_wanders_is_the_same_for_every_step():
    # A neutral body moves with the water: its velocity less that in still water is u, whose updates are exact.
    paths = []
    for repeat in REPEATS:
        moving, still = (
            run(repeat * GRID, every=0.2, members=8, force=(1e-30,) * 3, wander=wander).velocity
            for wander in (WANDER, WEAK)
        )
        paths.append(moving - still)
    assert np.abs(paths[0]).max() > 0.1
    for path in paths[1:]:
        np.testing.assert_allclose(path, paths[0], rtol=0.0, atol=1e-13)


@pytest.mark.ci
@pytest.mark.parametrize("repeat", REPEATS)
def test_mean_and_variance_are_those_of_the_exact_solution(repeat):
    # E v = v0 e^(-g t), Var v = S^2 / m^2 (1 - e^(-2 g t)) / (2 g); of the step: (g h)^2 / 6 of them, less than 2e-3.
    result = run(repeat * GRID, seed=100 + repeat)
    v, decay = result.velocity[-1], np.exp(-RATE * END)
    variance = (S / MASS) ** 2 * (1.0 - decay**2) / (2.0 * RATE)
    assert np.all(np.abs(v.mean(axis=0) - SPEED * decay) < ERRORS * np.sqrt(variance / MEMBERS) + 2e-3 * np.abs(SPEED))
    assert np.all(np.abs(v.var(axis=0) / variance - 1.0) < ERRORS * np.sqrt(2.0 / MEMBERS) + 2e-3)


@pytest.mark.ci
def test_halving_the_step_changes_paths_with_the_strong_order():
    # What a step leaves out of a path is the bridge between its ends: independent from step to step, of variance h^3 each.
    results = {repeat: run(repeat * GRID) for repeat in REPEATS}
    for name in ("position", "velocity"):
        ends = {repeat: getattr(result, name)[-1] for repeat, result in results.items()}
        changes = [np.std(ends[2 * repeat] - ends[repeat]) for repeat in REPEATS[:-1]]
        # 3 x 4096 numbers each: 0.6 % of a standard deviation, and a slope over log 4; g h = 0.1 bends it by its square.
        assert slope(np.array(REPEATS[:-1]), changes) == pytest.approx(1.0, abs=ERRORS * 0.0064 / np.log(4.0) + 0.01), (
            name
        )


@pytest.mark.ci
def test_members_keep_their_path_in_a_subset_and_in_a_store(tmp_path):
    h, whole = 4 * GRID, run(4 * GRID, members=300)
    subset = lw.solve(fleet(members=300).subset([5, 299, 6]), "psi_x", h=h, t1=END)
    np.testing.assert_array_equal(subset.position, whole.position[:, [5, 299, 6]])
    path = tmp_path / "run.zarr"
    lw.solve(fleet(members=300), "psi_x", h=h, t1=END, store=lw.Store(path), blocks=range(1))
    np.testing.assert_array_equal(lw.resume(path).position, whole.position)
    assert lw.open_run(path).provenance["scene"]["terms"][1]["noise_step"] == GRID


@pytest.mark.slow
@pytest.mark.parametrize("width", [1, 2, 4, 8, 16])
def test_every_width_draws_the_same(width):
    whole = run(4 * GRID, members=40)
    narrow = lw.solve(fleet(members=40), "psi_x", h=4 * GRID, t1=END, width=width)
    # The same numbers are drawn; another width is another kernel, whose sums may be fused otherwise.
    np.testing.assert_allclose(narrow.position, whole.position, rtol=0.0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_grid_of_the_run_is_no_grid(dtype):
    # One draw a step: the bits of a scene without noise_step, by another kernel, whose sums may be fused otherwise.
    ends = [
        lw.solve(fleet(members=40, grid=grid), "psi_x", h=GRID, t1=END, dtype=dtype).position for grid in (None, GRID)
    ]
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-14 if dtype == "float64" else 1e-5)


def test_a_scene_file_keeps_it_and_nothing_varies_it():
    scene = fleet(members=1).scene
    again = lw.Scene.from_dict(scene.to_dict())
    assert [term.noise_step for term in again.terms[1:]] == [GRID, GRID]
    assert "noise_step" not in terms.WrenchNoise(force=S).to_dict()
    assert not any("noise_step" in name for name in scene.parameters())
    with pytest.raises(lw.SceneError, match=r'"wrench_noise.noise_step".*does not name what the scene has'):
        lw.Ensemble(scene, 4, vary={"wrench_noise.noise_step": lw.distributions.Uniform(0.1, 0.2)})


@pytest.mark.parametrize("value", [0.0, -1.0, "short", [0.1, 0.2], np.nan])
@pytest.mark.parametrize("kind", [terms.WrenchNoise, terms.GaussMarkovCurrent])
def test_what_is_no_time_is_refused(kind, value):
    numbers = WANDER if kind is terms.GaussMarkovCurrent else {}
    with pytest.raises(lw.SceneError, match=rf"{kind.type}.noise_step = .*Give a number"):
        kind(**numbers, noise_step=value)


@pytest.mark.parametrize(("h", "every", "text"), [
    # 0.075 is nearer, but does not divide a second.
    (0.08, 1.0, r"step = 0.0769.*not a whole multiple of wrench_noise.noise_step = 0.025 s. Use a step of 0.1 s"),
    (0.01, 1.0, r"step = 0.01 .*Use a step of 0.025 s"),
    (0.05, 0.11, r"Give a noise_step that divides the 0.11 s between samples"),
])  # fmt: skip
def test_a_step_that_is_no_multiple_is_refused_with_the_nearest(h, every, text):
    with pytest.raises(lw.SceneError, match=text):
        make_plan(fleet(members=1), "psi_x", h, 11.0 * every, lw.SaveAt(every=every))


def test_a_third_of_a_second_is_a_multiple_of_a_ninth():
    plan = make_plan(fleet(members=1, grid=1.0 / 9.0), "psi_x", 1.0 / 3.0, 2.0)
    assert [term.draws(plan.grid.h) for term, _ in plan.kernel_choice.laws if isinstance(term, lw.laws.NoisyTerm)] == [
        3,
        3,
    ]


def test_more_draws_than_a_counter_has_are_refused():
    with pytest.raises(lw.SceneError, match=r"wrench_noise.noise_step = 1e-09: makes 4,000,000,000 draws in this run"):
        make_plan(fleet(members=1, grid=1e-9), "psi_x", 0.01, 4.0)


def test_steps_of_a_comparison_divide_the_draws():
    sample = Sample(fleet(members=2), 2.0).on_grid(48)
    assert [sample.allowed(m) for m in (1, 5, 13, 17, 48, 50)] == [1, 6, 16, 24, 48, 48]
    # The scene's own noise_step is kept, unless all are asked for.
    assert {term.noise_step for term in sample.ensemble.scene.terms[1:]} == {GRID}
    assert {term.noise_step for term in drawn_every(fleet(members=2), 0.5, own_grid=False).scene.terms[1:]} == {0.5}
    with pytest.raises(
        lw.SceneError, match=r"wrench_noise.noise_step = 0.03 does not divide the 0.1 s.*run.save_every"
    ):
        Sample(fleet(members=2, grid=0.03), 2.0)


@wp.func
def gust_law(w: Any, view: Any, p: Any):
    unity = ones(view.b.x)
    w.force = w.force + (unity / root(view.h * unity)) * (p.strength * normals_over(view, p.key, 1))
    return w


class Device:
    NOISE = True
    law = gust_law


class QuietDevice:
    law = gust_law


@dataclass(frozen=True, eq=False, kw_only=True)
class Gust(lw.laws.NoisyTerm):
    type: ClassVar[str] = "gust_of_test"
    device: ClassVar[Any] = Device
    strength: Any = lw.laws.number((3,), "N s^1/2", axes="vector")


@pytest.mark.ci
@pytest.mark.parametrize("noise_step", [None, KICK, KICK / 5.0])
def test_a_users_law_asks_for_the_draws_of_its_step(noise_step):
    gust = Gust(strength=S, noise_step=noise_step)
    bench = Bench(gust, Device, fleet(members=1).scene, packets=4, seed=12)
    bench.packets = Bank(bench, bench.context(bench.parameters), bench.views)
    law = WrenchNoise(seed0=12, channel=terms.noisy.channel(gust.key), noise_step=noise_step)
    for i, force in enumerate(bench.at(bench.views)["law"][:, :3]):
        draws = draws_of_step(law, View(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), 0.0, KICK, STEP, i), 1)
        expected = S * draws.sum(axis=0) / np.sqrt(len(draws) * KICK)
        np.testing.assert_allclose(force, expected, rtol=1e-13, atol=1e-13)


def test_check_law_takes_it_and_a_device_that_hides_its_noise_is_refused():
    assert lw.laws.check_law(Gust(strength=S)).ok

    @dataclass(frozen=True, eq=False, kw_only=True)
    class Quiet(Gust):
        type: ClassVar[str] = "quiet_gust_of_test"
        device: ClassVar[Any] = QuietDevice

    with pytest.raises(lw.SceneError, match=r"quiet_gust_of_test.device.*Write NOISE = True"):
        lw.laws.check_law(Quiet(strength=S))


SPLIT = ("psi_s", "psi_x", "psi_x8", "psi_w", "phi", "phi_adjoint")
EXPLICIT = ("rk4", "rk5", "rk5_ck", "rk8", "rkw3", "cg3", "rkmk4")
ORDERS = [*(("white", method) for method in (*SPLIT, *EXPLICIT)), *(("Gauss-Markov", method) for method in SPLIT)]


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "method"), ORDERS)
def test_the_order_by_paths(noise, method, capsys):
    repeats, grid = np.array([8, 16, 32, 64]), 1.0 / 1024.0
    white, wandering = (replace(term, noise_step=grid) for term in fleet(wander=WANDER).scene.terms[1:])
    scene = lw.Scene(
        vehicle(M=(2.0, 3.0, 4.0), moment=(0.1, -0.2, 0.3)), lw.Environment(GRAVITY),
        terms=[fleet().scene.terms[0], white if noise == "white" else wandering],
        start=lw.Start(velocity=SPEED, angular_velocity=(0.3, -0.4, 0.5)),
    )  # fmt: skip
    members = lw.Ensemble(scene, 256, 3)
    truth = lw.solve(members, "psi_x", h=grid, t1=2.0).position[-1]
    ends = [lw.solve(members, method, h=repeat * grid, t1=2.0).position[-1] for repeat in repeats]
    order = slope(repeats, [np.sqrt(np.mean((end - truth) ** 2)) for end in ends])
    with capsys.disabled():
        print(f"\n{noise} {method}: order by paths {order:.2f}")
    # 256 members, three axes: 2.6 % of each error, and the step of 1/16 bends the slope by its square.
    assert order == pytest.approx(1.0, abs=ERRORS * 0.026 / np.log(8.0) + 0.02)
