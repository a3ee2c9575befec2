# SPDX-License-Identifier: Apache-2.0
"""Vehicles as an environment of Gymnasium: the motion is that of a run, lane by lane, whenever an episode begins."""

import re
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_warp.control import Callback, CallbackInput, HeadingPID, LowPass, Sensor, SetPoint
from lgvi_warp.control.policy import INPUTS
from lgvi_warp.extensions.learning.observations import OBSERVATIONS
from lgvi_warp.reference.control import Measurement, Reference
from lgvi_warp.reference.control.policy import Policy as PolicyTwin
from tests.conftest import ROOT
from tests.control.test_callback import GAINS, ODD, H, heading, scene

N, PERIOD = 20, 5 * H
LAW = [HeadingPID(**GAINS)]
SETTINGS = dict(method="psi_s", h=H, instead_of="heading_pid")


def state(t, y, r):
    """The demand of the heading law, and the motion itself."""
    demand = heading(t, y, r, np.arange(len(y.heading)))[:, 5:]
    return np.concatenate([demand, y.position, y.attitude.reshape(-1, 9), y.velocity], axis=1)


def environment(fleet=None, **more):
    """Vehicles with the heading law's demand as the first number that they show."""
    return lw.gym.VectorEnv(fleet or scene(LAW), **dict(observe=state, outputs=["N"]) | SETTINGS | more)


def steer(env, observed, periods):
    """Close the loop in NumPy."""
    for _ in range(periods):
        observed, *rest = env.step(observed[:, :1])
    return observed, *rest


def solved(fleet, periods):
    """The motion of a run whose callback is the same law, as `state` shows it."""
    result = lw.solve(fleet, "psi_s", h=H, t1=periods * PERIOD, save=lw.SaveAt())
    shown = result.position[-1], result.attitude[-1].reshape(-1, 9), result.velocity[-1]
    return np.concatenate(shown, axis=1)


@pytest.fixture(scope="module")
def env():
    return environment()


def test_the_bits_of_a_run(env):
    observed, info = env.reset()
    assert info == {}
    assert env.time == 0.0
    observed = steer(env, observed, 50)[0]
    assert np.isclose(env.time, 50 * PERIOD)
    assert np.array_equal(observed[:, 1:], solved(scene([Callback(heading)]), 50))


@pytest.mark.parametrize("odd, words", ODD.values(), ids=ODD)
def test_what_is_no_real_number_is_refused(env, odd, words):
    actions, names = np.zeros((N, 1)), ("observe", "reward", "terminated")
    env.reset()
    with pytest.raises(ValueError, match=f"actions.*{words}"):
        env.step(odd(actions))
    for name in names[: 2 if odd is ODD["truth"][0] else 3]:  # truth values are what `terminated` gives
        with pytest.raises(ValueError, match=f"{name}.*{words}"):
            other = environment(
                **{name: lambda t, y, r, *, name=name: odd(np.zeros((N, 2) if name == "observe" else N))}
            )
            other.reset()
            other.step(actions)


@pytest.mark.ci
def test_members_that_come_again_have_other_noise():
    """Three given members, two environments: each member's first episode has its own noise, each later one new noise."""
    part = lw.Ensemble(
        replace(scene(LAW).scene, terms=[*scene(LAW).scene.terms, lw.terms.WrenchNoise(force=(1.0, 1.0, 1.0))]), 3, 3
    )
    given = part.select(0, 3)
    fleet = lw.Ensemble.from_states(part.scene, given.position, given.attitude, given.velocity, given.angular_velocity)
    env, ends, members = environment(fleet, num_envs=2), [], []
    for _ in range(6):
        observed, _ = env.reset()
        members += env.members.tolist()
        ends += list(steer(env, observed, 3)[0])
    assert members == [0, 1, 2] * 4
    assert len({end.tobytes() for end in ends}) == 12
    run = lw.solve(fleet.in_scene(replace(fleet.scene,
                                          controller=scene([Callback(heading)]).scene.controller)), "psi_s",
                   h=H, t1=3 * PERIOD, save=lw.SaveAt())  # fmt: skip
    np.testing.assert_array_equal([end[1:4] for end in ends[:3]], run.position[-1])


def test_members_that_start_while_others_go_on():
    def varied(law):
        numbers = {
            "vehicle.mass": lw.distributions.Normal(std=0.5),
            "drag.linear[5]": lw.distributions.Uniform(low=0.05, high=0.2),
        }
        fleet = scene([law])
        return lw.Ensemble(fleet.scene, N, 3, fleet.vary | numbers)

    env = environment(varied(*LAW))
    first, _ = env.reset(seed=7)
    later = steer(env, first, 10)[0]
    mask = np.zeros(N, bool)
    mask[[0, 9, 19]] = True
    both, _ = env.reset(options={"reset_mask": mask})
    assert np.array_equal(both[~mask], later[~mask])
    assert env.members[[0, 1, 9, 19]].tolist() == [20, 1, 29, 39]
    last = steer(env, both, 30)[0][:, 1:]
    drawn = varied(Callback(heading)).with_seed(7, 2 * N)
    assert np.array_equal(last[~mask], solved(drawn.subset(np.flatnonzero(~mask)), 40))
    assert np.array_equal(last[mask], solved(drawn.subset(env.members[mask]), 30))


def test_seeds(env):
    runs = [[env.reset(seed=seed)[0], env.reset()[0]] for seed in (3, 4, 3)]
    assert np.array_equal(runs[0], runs[2])
    assert not np.array_equal(runs[0][0], runs[0][1])
    assert not np.any(runs[0][0][:, -3:] == runs[1][0][:, -3:])
    mask = np.arange(N) == 5
    partly, _ = env.reset(seed=4, options={"reset_mask": mask})
    assert np.array_equal(partly[mask], runs[1][0][mask])
    assert np.array_equal(partly[~mask], runs[2][1][~mask])
    with pytest.raises(TypeError, match="one for all"):
        env.reset(seed=[1, 2])


def episodes(mode, **more):
    """Actions, and what six steps of an environment give whose episodes last three periods."""
    env = environment(duration=3 * PERIOD, reward=lambda t, y, r, a: 1.0 + a[:, 0], autoreset_mode=mode, **more)
    begun = env.reset(seed=1)[0]
    return env, begun, [env.step(np.full((N, 1), 0.5)) for _ in range(6 if mode != "Disabled" else 3)]


def test_the_next_step_begins_anew():
    env, begun, steps = episodes("NextStep")
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert [step[3].all() for step in steps] == [step[3].any() for step in steps] == [k == 2 for k in range(6)]
    assert [step[1][0] for step in steps] == [1.5, 1.5, 1.5, 0.0, 1.5, 1.5]
    assert not any(step[2].any() or step[4] for step in steps)
    fresh = environment()
    fresh.reset(seed=1)
    assert np.array_equal(steps[3][0], fresh.reset()[0])
    assert not np.array_equal(steps[3][0], begun)


def test_the_same_step_begins_anew():
    _, _, steps = episodes(AutoresetMode.SAME_STEP)
    assert [step[3].all() for step in steps] == [False, False, True] * 2
    assert [step[1][0] for step in steps] == [1.5] * 6
    usual = episodes("NextStep")[2]
    final = steps[2][4]
    assert final["_final_obs"].all()
    assert np.array_equal(np.stack(final["final_obs"]), usual[2][0])
    assert np.array_equal(steps[2][0], usual[3][0])
    assert np.array_equal(steps[3][0], usual[4][0])


def test_without_autoreset():
    env, _, steps = episodes("Disabled")
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(np.zeros((N, 1)))
    observed, _ = env.reset(options={"reset_mask": np.arange(N) < 7})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros((N, 1)))
    assert np.array_equal(observed[7:], steps[2][0][7:])
    env.reset(options={"reset_mask": np.arange(N) >= 7})
    assert not env.step(np.zeros((N, 1)))[3].any()
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment().step(np.zeros((N, 1)))


def test_members_without_a_command_end(env):
    env.reset(seed=2)
    whole = [env.step(np.zeros((N, 1))) for _ in range(4)]
    env.reset(seed=2)
    steps = []
    for k in range(4):
        actions = np.zeros((N, 1))
        actions[[3, 12], 0] = np.nan if k == 1 else 0.0
        steps.append(env.step(actions))
    others = ~np.isin(np.arange(N), [3, 12])
    assert [step[2].tolist() for step in steps] == [[False] * N, (~others).tolist(), [False] * N, [False] * N]
    infos = steps[1][4]
    assert infos["_status"].tolist() == (~others).tolist()
    assert np.all(infos["status"][[3, 12]] == lw.Status.CONTROL_NON_FINITE)
    assert all(np.array_equal(a[0][others], b[0][others]) for a, b in zip(steps, whole, strict=True))
    # They stand where they were at the tick before, and begin anew at the next step.
    assert np.array_equal(steps[1][0][~others], whole[0][0][~others])
    assert env.members[[3, 12]].tolist() == [N + 3, N + 12]


class One(gymnasium.Env):
    """An environment of a single vehicle, which Gymnasium's checker asks for."""

    def __init__(self):
        self.many = environment(num_envs=1, observe=["heading_error", "angular_velocity"], scale=1.0)
        self.action_space, self.observation_space = self.many.single_action_space, self.many.single_observation_space

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        observed, info = self.many.reset(seed=seed)
        return observed[0], info

    def step(self, action):
        observed, reward, ended, cut, info = self.many.step(action[None])
        return observed[0], float(reward[0]), bool(ended[0]), bool(cut[0]), info


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_gymnasiums_checker():
    check_env(One())


def test_gymnasiums_own_wrappers():
    env = environment(duration=3 * PERIOD, reward=lambda t, y, r: np.ones(N))
    assert isinstance(env, gymnasium.vector.VectorEnv)
    assert type(env).__name__ == "VectorEnv"
    env = RecordEpisodeStatistics(env)
    assert env.reset(seed=0)[0] in env.observation_space
    env.action_space.seed(0)
    steps = [env.step(env.action_space.sample()) for _ in range(3)]
    assert all(step[0] in env.observation_space for step in steps)
    assert np.array_equal(steps[2][4]["episode"]["r"], np.full(N, 3.0))


def test_named_numbers_are_those_of_a_policy():
    """The twin of `lw.control.Policy` sees the same of random motions, to the round-off of sums of six products."""
    rng, twin = np.random.default_rng(0), PolicyTwin()
    R = Rotation.random(2 * N, rng=rng).as_matrix()
    vectors = iter(rng.normal(size=(7, N, 3)))
    heading = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    y = CallbackInput(next(vectors), R[:N], next(vectors), next(vectors), heading[:N], water_velocity=next(vectors))
    r = CallbackInput(next(vectors), R[N:], next(vectors), next(vectors), heading[N:], speed=rng.normal(size=N))
    assert {name: OBSERVATIONS[name][:2] for name in INPUTS} == INPUTS
    for name in INPUTS:
        seen = np.reshape(OBSERVATIONS[name].of(y, r), (N, -1))
        for i in range(N):
            measured = Measurement(
                y.position[i], y.attitude[i], y.velocity[i], y.water_velocity[i], y.angular_velocity[i]
            )
            wanted = Reference(r.position[i], r.velocity[i], r.attitude[i], r.angular_velocity[i], r.speed[i])
            assert np.abs(seen[i] - twin.seen(name, wanted, measured)).max() < 1e-14, name


def test_the_page_lists_all_names():
    page = (ROOT / "docs" / "controllers" / "gym.md").read_text()
    rows = "".join(row for row in page.splitlines() if row.startswith("| `"))
    listed = set(re.findall(r"`(\w+)`", rows)) | {
        f"measured_{name}" for name in ("velocity", "water_velocity", "angular_velocity")
    }
    assert set(OBSERVATIONS) <= listed


def test_names_show_what_functions_do():
    names = ["heading_error", "down[1]", "measured_heading", "reference_heading", "measured_attitude[3]"]
    seen = environment().reset(seed=1)[0]
    R = seen[:, 4:13].reshape(-1, 3, 3)
    heading = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    expected = np.stack([0.8 - heading, R[:, 2, 1], heading, np.full(N, 0.8), R[:, 1, 0]], axis=1)
    assert np.abs(environment(observe=names).reset(seed=1)[0] - expected).max() < 1e-14


WRONG = {
    "observe": (dict(observe=["heading_eror"]), "Did you mean 'heading_error'"),
    "a wish": (dict(observe=["depth_error"]), "needs a wanted depth, which no guidance gives"),
    "act": (dict(act="demands"), "Did you mean 'demand'"),
    "a law": (dict(instead_of="heading"), "heading_pid"),
    "duration": (dict(duration=0.25), "not a whole number of periods of 0.1 s"),
    "number": (dict(num_envs=0), "Give a whole number from 1"),
    "outputs": (dict(outputs=["yaw"]), "is not known"),
    "twice": (dict(outputs=["N", "N"]), "is named twice"),
    "scale": (dict(scale=[1.0, 2.0]), r"has shape \(2,\)"),
    "mode": (dict(autoreset_mode="now"), "is not known"),
    "reward": (dict(reward=1.0), "is not a function"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input(case):
    settings, text = WRONG[case]
    with pytest.raises(lw.SceneError, match=text):
        environment(**settings)


def test_bad_input_to_calls(env):
    with pytest.raises(lw.SceneError, match="controller = None is not in the scene"):
        environment(lw.Scene(lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0))))
    env.reset()
    with pytest.raises(ValueError, match=r"have shape \(20, 2\). Give \(20, 1\)"):
        env.step(np.zeros((N, 2)))
    for mask, error in (([True] * N, TypeError), (np.zeros(N, bool), ValueError), (np.ones(3, bool), ValueError)):
        with pytest.raises(error, match="reset_mask"):
            env.reset(options={"reset_mask": mask})
    for name, text in (("observe", "k"), ("reward", "20"), ("terminated", "20")):
        with pytest.raises(ValueError, match=f"{name}: returned shape .*{text}"):
            wrong = environment(**{name: lambda t, y, r: np.zeros(3)})
            wrong.reset()
            wrong.step(np.zeros((N, 1)))


@pytest.fixture(scope="module")
def falling():
    """Vehicles that sink onto a floor at different times, seen by a late sensor and through a filter; commands are late."""
    controller = lw.Controller(
        period=PERIOD,
        delay=0.04,
        sensors=[Sensor(of="depth", latency=2, noise=0.0), LowPass(of="velocity", time_constant=1.0)],
        guidance=[SetPoint(heading=0.8)],
        laws=LAW,
    )
    terms = [lw.terms.ControlWrench(limit=2.0, time_constant=0.1)]
    vehicle = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0), buoyancy=10.0 * 9.80665 - 5.0)
    plain = lw.Scene(vehicle, terms=terms, controller=controller, events=[lw.events.Floor(depth=5.0)])
    fleet = lw.Ensemble(plain, N, 3, {"start.position[2]": lw.distributions.Uniform(low=0.0, high=4.9)})
    names = ["depth", "velocity[2]"]
    return lambda act="command": lw.gym.VectorEnv(fleet, act=act, observe=names, **SETTINGS)


@pytest.mark.slow
def test_events_and_sensors_of_later_episodes(falling):
    env = falling()
    assert np.array_equal(env.single_action_space.high, np.full(6, 2.0))
    begun, previous, ends = env.reset(seed=1)[0], None, 0
    for _ in range(60):
        observed, _, ended, _, infos = env.step(np.zeros((N, 6)))
        if previous is not None and previous[1].any():
            again = previous[1]
            # A late sensor has nothing but the first reading, the filter begins with what it sees: at rest.
            assert np.all(observed[again, 0] < 4.9)
            assert np.all(observed[again, 1] == 0.0)
            ends += again.sum()
        if previous is not None and previous[2].any():
            assert np.array_equal(observed[previous[2], 0], previous[0][previous[2], 0])
        if ended.any():
            assert np.all(infos["status"][ended] == lw.Status.FLOOR)
        started = np.zeros(N, bool) if previous is None else previous[1]
        previous = observed, ended, started
    assert ends > N / 2
    assert begun.shape == (N, 2)
