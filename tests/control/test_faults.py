# SPDX-License-Identifier: Apache-2.0
"""Faults of actuators, of sensors and of sensors of a filter, that end and that come and go: against a loop of their own.

The numbers of a fault are those of whole sequences here, which need no memory; `changed` shares no code with twin and device.
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_warp.control.fault import KINDS
from tests.control.bench import measured, scene
from tests.control.test_sensors import FIELDS_OF, motion
from tests.extensions.navigation.navigating import LOG, NOISES, voyage
from tests.support.loops import torpedo
from tests.support.tools import one

T, H, TICKS = 0.1, 0.02, 50
DEFAULTS = dict(
    time=0.0, until=np.inf, gain=0.0, offset=0.0, value=None, time_constant=1.0, delay=1.0, duty=1.0, period=1.0
)
NUMBERS = ("time", "until", "gain", "offset", "time_constant", "delay", "duty", "period")
# One member for each kind and each course of time: from the start, between two ticks, until beyond the end, on and off.
COURSES = (
    dict(time=0.0, until=1.0), dict(time=0.53, until=2.0), dict(time=1.0, until=1e3), dict(time=np.inf),
    dict(time=0.7, duty=0.4, period=0.8), dict(time=0.25, until=3.33, duty=0.5, period=0.26), dict(duty=0.0, period=0.5),
    dict(time=1.49, until=3.91, duty=1.0, period=0.3), dict(time=2.0, until=2.05), dict(time=2.01, until=2.05),
)  # fmt: skip
MEMBERS = len(KINDS) * len(COURSES)


def numbers_of(member, **more):
    """Kind and numbers of a member's fault."""
    course = COURSES[member // len(KINDS)]
    sizes = dict(gain=0.5, offset=0.3, time_constant=0.1 * (member % 5), delay=(0.0, 0.1, 0.26, 0.7)[member % 4])
    return DEFAULTS | sizes | course | {"kind": KINDS[member % len(KINDS)]} | more


def parameters(name, **more):
    """The numbers of all members' faults as an ensemble has them."""
    each = [numbers_of(m, **more) for m in range(MEMBERS)]
    drawn = {f"{name}.{key}": np.array([numbers[key] for numbers in each]) for key in NUMBERS}
    return drawn | {f"{name}.choice": np.array([float(KINDS.index(numbers["kind"])) for numbers in each])}


def active(k, f):
    """Whether a fault acts at tick k."""
    first = next((j for j in range(10**4) if j * T >= f["time"] - 1e-9), None)
    if first is None or k < first or k * T >= f["until"] - 1e-9:
        return False
    if f["kind"] != "intermittent":
        return True
    cycle = max(1, round(f["period"] / T))
    return (k - first) % cycle < f["duty"] * cycle - 1e-9


def changed(x, f, place=None, angle=False, lost="held"):
    """The numbers x at all ticks as a fault leaves them; place: where the actuator is at each tick; lost: what that means."""
    y = np.array(x, float)
    for k in range(len(x)):
        if not active(k, f):
            continue
        onset = k
        while onset > 0 and active(onset - 1, f):
            onset -= 1
        before = y[onset - 1] if onset > 0 else x[0]
        kind = "freeze" if f["kind"] == "intermittent" and lost == "held" else f["kind"]
        if kind == "stuck" and f["value"] is not None:
            y[k] = f["value"]
        elif kind == "stuck":
            y[k] = before if place is None else place[onset]
        elif kind == "freeze":
            y[k] = before
        elif kind == "delay":
            arrived = k - int(np.rint(f["delay"] / T))
            y[k] = x[arrived] if arrived >= onset else before
        elif kind == "slow":
            # The filter of the first order from the onset on, as a sum over all that it has seen.
            left = math.exp(-T / f["time_constant"]) if f["time_constant"] > 0.0 else 0.0
            at = before
            for j in range(onset, k + 1):
                step = x[j] - at
                at += (1.0 - left) * (math.remainder(step, 2.0 * math.pi) if angle else step)
            y[k] = at
        else:
            y[k] = f["offset"] + (x[k] if kind == "offset" else f["gain"] * x[k])
    return y


# Sensors ------------------------------------------------------------------------------------------------------------

# Parts of the measurement that a fault of each sensor changes, and the channel.
SENSED = {"depth": 0, "heading": 0, "position": 1, "velocity": "all", "water_velocity": 2, "angular_velocity": 0}


def kinds(name, of, channel=0, **more):
    return lw.control.Fault(name=name, of=of, channel=channel, kind=KINDS, **more)


@pytest.fixture(scope="module")
def sensed():
    """Readings of ideal sensors, each with its fault; the velocity has two, of which the second hits the first's channel 1."""
    sensors = [lw.control.Sensor(name=of, of=of) for of in SENSED]
    faults = [kinds(f"f_{of}", of, channel) for of, channel in SENSED.items()] + [kinds("second", "velocity", 1)]
    varied = {}
    for name in [f"f_{of}" for of in SENSED]:
        varied |= parameters(name)
    other = {key: np.roll(values, 9) for key, values in parameters("second").items()}
    truth = motion(TICKS, MEMBERS, T)
    return truth, measured(one(scene(sensors, faults, T), parameters=varied | other), truth, H)


def headings(rows):
    return np.arctan2(rows[..., 6], rows[..., 3])


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("of", SENSED)
def test_a_sensors_fault_is_that_of_an_own_loop(sensed, of):
    truth, seen = sensed
    for m in range(MEMBERS):
        f = numbers_of(m)
        if of == "heading":
            wanted = changed(headings(truth[:, m]), f, angle=True)
            error = np.remainder(headings(seen[:, m]) - wanted + np.pi, 2.0 * np.pi) - np.pi
        else:
            columns = FIELDS_OF[of]
            wanted = truth[:, m, columns].copy()
            # The depth is the third number of the position, whose second has the other fault.
            chosen = range(wanted.shape[1]) if SENSED[of] == "all" else [SENSED[of]]
            for i in chosen:
                wanted[:, i] = changed(wanted[:, i], f)
            if of == "velocity":
                wanted[:, 1] = changed(wanted[:, 1], numbers_of((m - 9) % MEMBERS))
            if of == "position":
                wanted[:, 2] = changed(wanted[:, 2], f)
            error = seen[:, m, columns] - wanted
        assert np.abs(error).max() < 1e-12, (m, f)
    assert not np.array_equal(seen, truth)


@pytest.mark.kernel
@pytest.mark.slow
def test_a_fault_of_angles_and_of_a_range():
    """Roll, pitch and yaw of an attitude; the reading of an altimeter over a flat floor."""
    floor = lw.events.Floor(depth=40.0, clearance=-100.0)
    sensors = [lw.control.Altimeter(), lw.control.Sensor(name="ahrs", of="attitude")]
    faults = [kinds("tilted", "ahrs", "all"), kinds("echo", "altimeter")]
    varied = parameters("tilted", offset=0.05) | parameters("echo")
    truth = motion(TICKS, MEMBERS, T)
    level = truth.copy()
    level[..., 3:12] = np.eye(3).reshape(-1)
    fleet = one(scene(sensors, faults, T, [floor]), parameters=varied)
    seen = measured(fleet, truth, H)
    R, S = (rows[..., 3:12].reshape(TICKS, MEMBERS, 3, 3) for rows in (truth, seen))
    row = fleet.scene.controller.bus.ranges["altimeter"]
    ranges = []
    for k in range(TICKS):
        measured(fleet, level[: k + 1], H, bus=ranges)
    for m in range(MEMBERS):
        f = numbers_of(m, offset=0.05)
        old, new = (Rotation.from_matrix(A[:, m]).as_euler("ZYX")[:, ::-1] for A in (R, S))
        wanted = np.stack([changed(old[:, i], f, angle=True) for i in range(3)], axis=1)
        # Angles beyond a right angle of pitch are those of another triple.
        good = np.abs(wanted[:, 1]) < 1.5
        error = np.remainder(new - wanted + np.pi, 2.0 * np.pi) - np.pi
        assert np.abs(error[good]).max() < 1e-12, (m, f)
        heard = np.array([rows[row, m] for rows in ranges])
        assert np.abs(heard - changed(40.0 - level[:, m, 2], numbers_of(m))).max() < 1e-12


# Sensors of a filter ------------------------------------------------------------------------------------------------


@pytest.mark.kernel
@pytest.mark.slow
def test_a_fault_of_a_filters_sensor_is_that_of_an_own_loop():
    """Numbers that the filter gets, one by one: IMU, beams, fixes, depth and heading, some new at some ticks alone."""
    sensors = [
        lw.control.IMU(**NOISES), lw.control.DVL(**LOG | {"dropout": 0.3}),
        lw.control.Sensor(name="cell", of="depth", noise=0.02),
        lw.control.Sensor(name="gps", of="position", noise=1.0, every=3),
        lw.control.Sensor(name="compass", of="heading", noise=0.02, dropout=0.2),
        lw.control.ErrorStateFilter(dvl="dvl", depth="cell", fix="gps", heading="compass"),
    ]  # fmt: skip
    hit = {"imu": 4, "dvl": 2, "cell": 0, "gps": "all", "compass": 0}
    faults = [kinds(f"f_{key}", key, channel) for key, channel in hit.items()]
    varied, off = {}, {}
    for key in hit:
        varied |= parameters(f"f_{key}")
        off[f"f_{key}.time"] = np.full(MEMBERS, np.inf)
    truth = voyage(TICKS, T)
    fleets = [one(scene(sensors, faults, T), parameters=varied | more) for more in (off, {})]
    handed = fleets[0].scene.controller.bus.handed
    raw, seen = [], []
    for k in range(TICKS):
        for fleet, rows in zip(fleets, (raw, seen), strict=True):
            measured(fleet, truth[: k + 1], H, bus=rows)
    raw, seen = np.array(raw), np.array(seen)
    # Numbers and flags of each sensor: first row of the numbers, count, row of the flag of number i.
    flags = {"imu": None, "dvl": lambda i: 4 + i, "cell": lambda i: 1, "gps": lambda i: 3, "compass": lambda i: 1}
    for key, channel in hit.items():
        first = handed[key]
        for m in range(MEMBERS):
            f = numbers_of(m)
            if key == "imu":
                f = f | {"offset": T * f["offset"]}
            for i in range(3) if channel == "all" else [channel]:
                x, got = raw[:, first + i, m], seen[:, first + i, m]
                fresh = np.ones(TICKS, bool) if flags[key] is None else raw[:, first + flags[key](i), m] > 0.5
                on = np.array([active(k, f) for k in range(TICKS)])
                gone = on & (f["kind"] == "intermittent") & (flags[key] is not None)
                if flags[key] is not None:
                    assert np.array_equal(seen[:, first + flags[key](i), m] > 0.5, fresh & ~gone)
                last = np.maximum.accumulate(np.where(fresh, np.arange(TICKS), 0))
                wanted = changed(x[last], f, angle=key == "compass", lost="gain")
                looked = fresh & ~gone
                assert np.abs(got - wanted)[looked].max(initial=0.0) < 1e-12, (key, m, f)
        others = [j for j in range(handed[key], handed[key] + 4) if channel not in ("all", j - handed[key])]
        if key in ("imu", "dvl"):
            assert np.array_equal(seen[:, others], raw[:, others])


# Actuators ----------------------------------------------------------------------------------------------------------

J, KP, KI, KD, KU = 4.5, 2.0, 0.3, 3.0, 8.0
LAG, EVERY, STEPS = 0.15, 5, 200
GOAL, SPEED = 0.3, 0.5


def loop(faults, lag=0.0, **controller):
    vehicle = torpedo(196.0, (0.0, 0.0, -0.02), (1.5, 4.0, J))
    guidance = [lw.control.SetPoint(heading=GOAL, speed=SPEED)]
    laws = [lw.control.HeadingPID(kp=KP, ki=KI, kd=KD), lw.control.SpeedPID(kp=KU)]
    parts = lw.Controller(period=EVERY * H, guidance=guidance, laws=laws, faults=faults, **controller)
    terms = [lw.terms.ControlWrench(time_constant=lag)]
    return lw.Scene(vehicle, lw.Environment(9.8), terms, controller=parts)


TWO = [kinds("yaw", "control_wrench", 5), kinds("again", "control_wrench", 5), kinds("ahead", "control_wrench", 0)]
PARAMETERS = (
    parameters("yaw")
    | {key: np.roll(values, 9) for key, values in parameters("again").items()}
    | {key: np.roll(values, 4) for key, values in parameters("ahead").items()}
)
SAVED = ("attitude", "angular_velocity", "velocity", "command", "actuator")


def run(fleet, **settings):
    saving = {"every": H, "fields": SAVED, "final": True}
    return lw.solve(fleet, "rk4", **{"h": H, "t1": STEPS * H, "save": lw.SaveAt(**saving)} | settings)


def demanded(result, m):
    """Demands (ticks, 2) of the laws, ahead and about the vertical, of the motion that was saved."""
    R, w, v = (result.samples[name][:-1:EVERY, m] for name in ("attitude", "angular_velocity", "velocity"))
    error = GOAL - np.arctan2(R[:, 1, 0], R[:, 0, 0])
    integral = T * np.concatenate([[0.0], np.cumsum(error)[:-1]])
    return np.stack([KU * (SPEED - v[:, 0]), KP * error + KI * integral - KD * w[:, 2]], axis=1)


def followed(u, lag):
    """Places of an actuator after each step, (steps + 1,), from the commands of the steps."""
    n = np.zeros(len(u) + 1)
    for k, command in enumerate(u):
        n[k + 1] = command + math.exp(-H / lag) * (n[k] - command) if lag > 0.0 else command
    return n


@pytest.fixture(scope="module", params=["at once", pytest.param("lagging", marks=pytest.mark.slow)])
def driven(request):
    """Lag [s], and the result of the loop with two faults on the rudder's channel and one on the other."""
    lag = LAG if request.param == "lagging" else 0.0
    return lag, run(one(loop(TWO, lag), parameters=PARAMETERS))


@pytest.mark.ci
@pytest.mark.kernel
def test_an_actuators_faults_are_those_of_an_own_loop(driven):
    """Commands, and where actuators are, of the laws' demands; the integral goes on through onsets and ends."""
    lag, result = driven
    assert result.status.counts() == {"ok": MEMBERS}
    for m in range(MEMBERS):
        ahead, yaw = demanded(result, m).T
        for channel, x, chain in ((0, ahead, [m - 4]), (5, yaw, [m, m - 9])):
            # Where it is at an onset follows from what came before: the second fault sees what the first has left.
            place = result.actuator[:-1:EVERY, m, channel] if lag > 0.0 else None
            for of in chain:
                x = changed(x, numbers_of(of % MEMBERS), place, lost="gain")
            assert np.abs(result.command[:-1:EVERY, m, channel] - x).max() < 1e-12, (m, channel)
            at = followed(np.repeat(x, EVERY), lag)
            if lag > 0.0:
                assert np.abs(result.actuator[1:, m, channel] - at[1:]).max() < 1e-12, (m, channel)


@pytest.mark.ci
@pytest.mark.kernel
def test_the_whole_loop_is_an_own_one(driven):
    """Headings of a loop that knows nothing of the result: exact between ticks, as commands are held, while it turns alone."""
    if driven[0] > 0.0:
        pytest.skip("a moment that lags is no polynomial of time: its run has an error of the method")
    still = {
        "speed_pid.kp": np.zeros(MEMBERS),
        "ahead.time": np.full(MEMBERS, np.inf),
        "ahead.until": np.full(MEMBERS, np.inf),
    }
    result = run(one(loop(TWO), parameters=PARAMETERS | still))
    heading = np.arctan2(result.attitude[..., 1, 0], result.attitude[..., 0, 0])
    for m in range(MEMBERS):
        angle, rate, integral, demands = 0.0, 0.0, 0.0, []
        angles = [0.0]
        for _ in range(STEPS // EVERY):
            error = GOAL - angle
            demands.append(KP * error + KI * integral - KD * rate)
            integral += T * error
            x = np.array(demands)
            for of in (m, m - 9):
                x = changed(x, numbers_of(of % MEMBERS), lost="gain")
            for _ in range(EVERY):
                angle += H * rate + 0.5 * H * H * x[-1] / J
                rate += H * x[-1] / J
                angles.append(angle)
        assert np.abs(angles).max() < np.pi
        # A step of rk4 turns by its polynomial of the fourth order: (rate h)^5 / 120 a step.
        assert np.abs(heading[:, m] - angles).max() < 1e-12 + STEPS * (np.abs(rate) * H) ** 5, m


@pytest.mark.kernel
@pytest.mark.slow
def test_faults_of_late_commands():
    """With a delay of periods and steps a fault hits what acts, before the newest command arrives and from then on."""
    delays = np.array([0, 3, 5, 12])[np.arange(MEMBERS) % 4]
    result = run(one(loop(TWO[:1]), parameters=parameters("yaw") | {"controller.delay": delays * H}))
    for m in range(MEMBERS):
        demands, f = demanded(result, m)[:, 1], numbers_of(m)
        wholes, rest = divmod(delays[m], EVERY)
        arrived = np.concatenate([np.zeros(wholes + 1), demands])[: len(demands) + 1]
        old, new = arrived[:-1], arrived[1:]
        after = changed(new, f, lost="gain")
        for k in range(len(new)):
            before = old[k]
            if active(k, f):
                memory = f["kind"] in ("freeze", "slow", "delay")
                before = (after[k - 1] if k > 0 else new[0]) if memory else f["offset"] + f["gain"] * before
                before = old[k] + f["offset"] if f["kind"] == "offset" else before
                before = after[k] if f["kind"] == "stuck" else before
            for s in range(EVERY):
                # Step EVERY k + s holds this; the actuator without lag is there at its end.
                wanted = after[k] if s >= rest else before
                got = result.actuator[EVERY * k + s, m, 5]
                if s > 0:
                    assert abs(got - wanted) < 1e-12, (m, k, s, f)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_run_that_goes_on_in_the_middle_of_faults_has_the_same_bits(driven):
    lag, whole = driven
    fleet = one(loop(TWO, lag), parameters=PARAMETERS)
    first = run(fleet, t1=60 * H)
    second = run(fleet, start=first.final)
    for name in SAVED:
        assert np.array_equal(second.samples[name][1:], whole.samples[name][61:]), name


@pytest.mark.ci
@pytest.mark.kernel
def test_blocks_and_threads_change_no_bit(driven, tmp_path):
    lag, whole = driven
    fleet = one(loop(TWO, lag), parameters=PARAMETERS)
    stored = lw.Store(tmp_path / "run.zarr", chunk_bytes=20_000)
    for settings in ({"threads": 1}, {"threads": 2, "store": stored}):
        again = run(fleet, **settings)
        assert all(np.array_equal(again.samples[name], whole.samples[name]) for name in SAVED), settings
    some = {name: values[20:25] for name, values in PARAMETERS.items()}
    few = run(one(loop(TWO, lag), parameters=some))
    assert all(np.array_equal(few.samples[name], whole.samples[name][:, 20:25]) for name in SAVED)


# Refusals, and what is absent -----------------------------------------------------------------------------------------

REFUSED = {
    "until": (dict(time=5.0, until=5.0), "fault.until = 5.0 is not after time = 5"),
    "kind": (dict(kind="broken"), "fault.kind = 'broken'"),
    "kinds": (dict(kind=["gain", "lost"]), "fault.kind = 'lost'"),
    "no kind": (dict(kind=[]), "is no kind of fault"),
    "choice": (dict(kind=["gain", "slow"], choice=2.0), "Give 0 to 1"),
    "part of a choice": (dict(kind=["gain", "slow"], choice=0.5), "choice = 0.5 is not a whole number. Give 0 or 1"),
    "value": (dict(kind="freeze", value=1.0), "is of a fault of the kind stuck"),
    "duty": (dict(duty=1.5), "fault.duty = 1.5"),
    "period": (dict(period=0.0), "fault.period = 0.0"),
    "delay": (dict(kind="delay", delay=-1.0), "fault.delay = -1.0"),
    "known": (dict(known=True, until=9.0), "leaves the channel out for good"),
    "channel": (dict(channel="both"), "fault.channel = 'both' is not a whole number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_fault_is_refused(name):
    numbers, words = REFUSED[name]
    with pytest.raises(lw.SceneError) as caught:
        lw.control.Fault(of="control_wrench", **numbers)
    assert words in str(caught.value)


def test_members_that_end_before_they_begin_are_refused():
    fault = lw.control.Fault(of="control_wrench", channel=5, time=1.0, until=4.0)
    varied = {"fault.time": np.array([1.0, np.inf, 4.0])}
    with pytest.raises(lw.SceneError, match=r"fault\.until"):
        one(loop([fault]), parameters=varied)
    with pytest.raises(lw.SceneError, match="is more than 1000 periods"):
        loop([lw.control.Fault(of="control_wrench", kind="delay", delay=200.0)])


def test_what_no_members_fault_has_is_no_code():
    from lgvi_kernels import built_in
    from lgvi_warp.runs.settle import make_plan

    def module(**numbers):
        plan = make_plan(
            lw.Ensemble(loop([lw.control.Fault(of="control_wrench", channel=5, **numbers)]), 4), "psi_s", H, 1.0
        )
        return plan.spec.control.parts[-1]

    assert module(gain=0.5) is built_in("laws.control", "fault:command")
    assert module(kind="stuck", value=0.5) is module(gain=0.5)
    assert module(until=3.0) is built_in("laws.control", "fault:command,until")
    assert module(kind=["offset", "slow"]) is module(gain=0.5)
    assert module(kind=["offset", "slow"], choice=1.0) is built_in("laws.control", "fault:command,held")


def test_a_scene_with_faults_is_its_own_file():
    first = loop([lw.control.Fault(of="control_wrench", kind=["stuck", "delay"], channel="all", until=20.0)])
    again = lw.Scene.from_dict(first.to_dict())
    assert again.to_dict() == first.to_dict()
    assert again.controller.faults[0].kinds_listed == ("stuck", "delay")
