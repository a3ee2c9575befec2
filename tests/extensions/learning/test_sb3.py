# SPDX-License-Identifier: Apache-2.0
"""`lw.gym.sb3`: Stable-Baselines3's `VecEnv` over the vehicles, and the bounds of what a learner sees."""

import copy
import pickle
import runpy
import subprocess
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.extensions.learning.test_gym import LAW, PERIOD, N, One, environment, scene
from tests.extensions.learning.vec_env import stand_in

SEEN = dict(observe=["heading_error", "angular_velocity"], scale=1.0)


@pytest.fixture(autouse=True)
def base_class(monkeypatch):
    """Stable-Baselines3's, or what stands for it."""
    stand_in(monkeypatch)


def paid(t, y, r, actions):
    """A reward that a copy of an environment may take along."""
    return 1.0 / 3.0 + actions[:, 0]


def some(count, width=1, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, width))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_steps_are_those_of_gymnasiums_same_step(mode):
    """The same numbers, whatever the autoreset of the environment; episodes end by a fault and by time."""
    settings = SEEN | dict(duration=4 * PERIOD, reward=paid)
    theirs = environment(**settings, autoreset_mode="SameStep")
    ours = lw.gym.sb3(environment(**settings, autoreset_mode=mode))
    ours.seed(5)
    assert np.array_equal(ours.reset(), theirs.reset(seed=5)[0])
    ended = np.zeros(N, int)
    for k in range(10):
        actions = some(N, seed=k)
        actions[3] = np.nan if k == 1 else actions[3]
        seen, reward, done, infos = ours.step(actions)
        expected, paid_now, terminated, truncated, more = theirs.step(actions)
        assert np.array_equal(seen, expected)
        assert reward.dtype == np.float32
        assert np.array_equal(reward, paid_now.astype(np.float32), equal_nan=True)
        assert np.array_equal(done, terminated | truncated)
        assert [i for i, info in enumerate(infos) if info] == np.flatnonzero(done).tolist()
        for i in np.flatnonzero(done):
            assert np.array_equal(infos[i]["terminal_observation"], more["final_obs"][i])
            assert infos[i]["TimeLimit.truncated"] == (not terminated[i])
            assert infos[i].get("status") == (lw.Status.CONTROL_NON_FINITE if terminated[i] else None)
        ended += done
    assert ended[3] == 3  # at steps 2, 6 and 10; the others at 4 and 8
    assert np.all(np.delete(ended, 3) == 2)


def test_an_action_without_a_number_ends_its_vehicle_alone():
    env = lw.gym.sb3(environment(**SEEN))
    env.seed(1)
    env.reset()
    whole = env.step(some(N))[0]
    env.seed(1)
    env.reset()
    actions = some(N)
    actions[7] = np.nan
    seen, _, done, infos = env.step(actions)
    assert done.tolist() == [i == 7 for i in range(N)]
    assert infos[7]["status"] == lw.Status.CONTROL_NON_FINITE
    assert not infos[7]["TimeLimit.truncated"]
    assert np.isfinite(seen).all()
    assert np.array_equal(np.delete(seen, 7, axis=0), np.delete(whole, 7, axis=0))


@pytest.mark.parametrize("both", [False, True])
def test_episodes_of_one_step(both):
    """A vehicle both terminated and out of time is terminated."""
    terminated = (lambda t, y, r: np.arange(N) < 5) if both else None
    env = lw.gym.sb3(environment(**SEEN, duration=PERIOD, terminated=terminated))
    first = env.reset()
    members = []
    for _ in range(3):
        members.append(np.array(env.get_attr("members")))
        seen, _, done, infos = env.step(some(N))
        assert done.all()
        assert [info["TimeLimit.truncated"] for info in infos] == [not (both and i < 5) for i in range(N)]
        assert not any(np.array_equal(info["terminal_observation"], row) for info, row in zip(infos, seen, strict=True))
    assert np.array_equal(members, np.arange(3 * N).reshape(3, N))
    assert not np.array_equal(first, seen)


def test_one_vehicle_has_the_bits_of_many():
    """The first of 4,096 and a single one see and do the same."""
    seen = []
    for count in (1, 4096):
        env = lw.gym.sb3(environment(**SEEN, num_envs=count, duration=2 * PERIOD))
        env.seed(4)
        rows = [env.reset()]
        for k in range(2):
            rows.append(env.step(np.tile(some(1, seed=k), (count, 1)))[0])
        seen.append([row[0] for row in rows])
        assert len(env.get_attr("render_mode")) == count
    assert np.array_equal(seen[0][:2], seen[1][:2])
    # The next episode of one is member 1, of 4,096 member 4,096.
    assert not np.array_equal(seen[0][2], seen[1][2])


def test_copies_have_not_begun():
    env = lw.gym.sb3(environment(**SEEN, reward=paid))
    env.seed(2)
    begun = env.reset()
    for other in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        with pytest.raises(gymnasium.error.ResetNeeded):
            other.step(some(N))
        other.seed(2)
        assert np.array_equal(other.reset(), begun)
        assert other.observation_space == env.observation_space
    assert np.array_equal(env.step(some(N))[0], other.step(some(N))[0])


def test_attributes_and_methods():
    env = lw.gym.sb3(environment(**SEEN))
    env.reset()
    assert env.get_attr("members", [0, 3]) == [0, 3]
    assert env.get_attr("num_envs", 2) == [N]
    assert not env.has_attr("nothing_of_the_kind")
    env.set_attr("colour", "red")
    assert env.get_attr("colour") == ["red"] * N
    assert env.env_is_wrapped(gymnasium.Wrapper, [0, 1]) == [False, False]
    seen = env.env_method("reset", seed=9, indices=1)[0]
    assert seen[0].shape == (N, 4)
    assert env.get_images() == [None] * N
    env.close()
    env.close()


def test_what_is_refused():
    env = lw.gym.sb3(environment(**SEEN))
    with pytest.raises(RuntimeError, match="Call step_async"):
        env.step_wait()
    with pytest.raises(ValueError, match="share their attributes"):
        env.set_attr("colour", "red", [0])
    env.set_options({"reset_mask": np.ones(N, bool)})
    with pytest.raises(ValueError, match="there are none to set"):
        env.reset()
    with pytest.raises(lw.SceneError, match=r"has actions without bounds.* Give scale="):
        lw.gym.sb3(environment(observe=["heading_error"]))
    with pytest.raises(lw.SceneError, match=r"'One' is not a lw.gym.VectorEnv"):
        lw.gym.sb3(One())


def test_a_seed_of_numpys_generator():
    env = lw.gym.sb3(environment(**SEEN))
    begun = []
    for _ in range(2):
        np.random.seed(3)
        drawn = env.seed()
        assert drawn == [drawn[0]] * N
        begun.append(env.reset())
    assert np.array_equal(*begun)


def limits(fleet, *names):
    """The least and the largest that an environment says of numbers."""
    space = environment(fleet, observe=list(names)).single_observation_space
    return space.low.tolist(), space.high.tolist()


def test_angles_and_rotations_have_bounds():
    low, high = limits(scene(LAW), "heading_error", "down", "measured_attitude[4]", "velocity[0]", "depth")
    assert high == [np.pi, 1.0, 1.0, 1.0, 1.0, np.inf, np.inf]
    assert low == [-each for each in high]


@pytest.mark.ci
@pytest.mark.slow_for("float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_what_is_seen_lies_within_its_bounds(dtype):
    """Vehicles sink onto the floor and turn over on their way; the last two begin beyond it."""
    sinking = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0), buoyancy=10.0 * 9.80665 - 5.0)
    plain = replace(scene(LAW).scene, vehicle=sinking, events=[lw.events.Floor(depth=3.0)])
    given = lw.Ensemble(plain, N, 3).select(0, N)
    depth, turning = np.linspace(0.0, 3.2, N), np.random.default_rng(1).normal(0.0, 3.0, (N, 3))
    places = np.stack([0.0 * depth, 0.0 * depth, depth], axis=1)
    fleet = lw.Ensemble.from_states(plain, places, given.attitude, given.velocity, turning)
    names = ["depth", "down", "measured_attitude", "heading_error", "measured_heading"]
    env = environment(fleet, observe=names, dtype=dtype)
    seen, deepest, floors = env.reset()[0], 0.0, 0
    for _ in range(40):
        assert seen in env.observation_space
        deepest = max(deepest, seen[:, 0].max())
        seen, _, ended, _, infos = env.step(np.zeros((N, 1)))
        floors += np.sum(infos["status"][ended] == lw.Status.FLOOR) if ended.any() else 0
    assert deepest == 3.0
    assert floors > N / 2


@pytest.mark.filterwarnings("ignore:.*action space has dtype float64.*:UserWarning")
def test_the_checker_and_the_wrappers_of_stable_baselines():
    """Its checker takes single environments; its wrappers stand for learners. Gymnasium's checker: test_gym.py."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    single = One()
    assert single.many.num_envs == 1
    checker.check_env(single)
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    env = environment(**SEEN, duration=3 * PERIOD, reward=paid)
    wrapped = vec_env.VecNormalize(vec_env.VecMonitor(vec_env.VecCheckNan(lw.gym.sb3(env), raise_exception=True)))
    assert isinstance(wrapped, vec_env.VecEnv)
    assert wrapped.reset().shape == (N, 4)
    infos = [wrapped.step(some(N, seed=k))[3] for k in range(3)][-1]
    assert all(info["episode"]["l"] == 3 for info in infos)


def test_advantages_are_sums_of_what_surprises():
    """Advantages of ppo.py, beside the sums over the rest of the same episode, term by term (Schulman et al. 2016, 16)."""
    pytest.importorskip("torch")
    ppo = runpy.run_path(str(ROOT / "examples" / "controllers" / "ppo.py"))
    rng, steps, count = np.random.default_rng(2), 9, 4
    rewards, values, following = rng.normal(size=(3, steps, count))
    ended = rng.random((steps, count)) < 0.3
    found = ppo["advantages"](rewards, values, ended, following)
    decay = ppo["DISCOUNT"] * ppo["TRACE"]
    for i in range(count):
        for k in range(steps):
            last = next((j for j in range(k, steps) if ended[j, i]), steps - 1)
            surprises = [rewards[j, i] + ppo["DISCOUNT"] * following[j, i] - values[j, i] for j in range(k, last + 1)]
            assert found[k, i] == pytest.approx(sum(s * decay**n for n, s in enumerate(surprises)), abs=1e-12)


@pytest.mark.slow
def test_two_learners_keep_the_depth_better_than_the_law(tmp_path):
    """200,000 steps each; then on 1,000 vehicles that they have not met, in the kernel."""
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("torch")
    picture = tmp_path / "learnt.png"
    script = ROOT / "examples" / "controllers" / "learn_depth_keeping.py"
    command = [sys.executable, script, "200000", picture]
    *lines, last = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    errors = {line.partition(":")[0]: float(line.split()[-2]) for line in lines}
    assert list(errors) == ["PPO of Stable-Baselines3", "ppo.py", "depth_pid"]
    assert errors["PPO of Stable-Baselines3"] < errors["depth_pid"]
    assert errors["ppo.py"] < errors["depth_pid"]
    assert last == str(picture)
    assert picture.stat().st_size > 10_000
