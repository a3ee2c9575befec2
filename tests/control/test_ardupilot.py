# SPDX-License-Identifier: Apache-2.0
"""The bridge to ArduPilot's JSON interface: packets over loopback, those lost, repeated and strange, signs of the motors."""

import json
import socket
import subprocess
import sys
import threading
from functools import partial

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support import servo_packets
from tests.support.bridges import example
from tests.support.servo_packets import KEPT, packet, packets, pulses

BRIDGE = example("ardupilot_json")
STILL = [1500] * 16
# No answer takes longer, or the test has failed.
PATIENCE = 20.0


@pytest.fixture(scope="module")
def vehicle():
    return BRIDGE.Vehicle()


@pytest.fixture(autouse=True)
def anew(vehicle):
    vehicle.frame = None
    vehicle.lost = vehicle.repeated = vehicle.strange = vehicle.starts = 0


def told(vehicle, sent):
    answer = vehicle.answer(sent)
    assert answer[:1] == answer[-1:] == b"\n"
    assert b" " not in answer
    return json.loads(answer)


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


@pytest.mark.ci
def test_the_kept_exchange_over_loopback(vehicle):
    """The bytes that are kept are sent by UDP; the answers are those that are kept, but for round-off of other processors."""
    kept = [json.loads(line) for line in KEPT.read_text().splitlines()]
    assert [bytes.fromhex(line["packet"]) for line in kept] == packets()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot,
    ):
        door.bind(("127.0.0.1", 0))
        door.settimeout(PATIENCE)
        autopilot.settimeout(PATIENCE)
        server = threading.Thread(target=BRIDGE.serve, args=(vehicle, door, len(kept)))
        server.start()
        got = []
        for line in kept:
            autopilot.sendto(bytes.fromhex(line["packet"]), door.getsockname())
            if line["answer"]:
                got.append(json.loads(autopilot.recv(4096)))
        server.join(PATIENCE)
        assert not server.is_alive()
        # The strange ones had no answer: none is left.
        autopilot.setblocking(False)
        with pytest.raises(BlockingIOError):
            autopilot.recv(4096)
    for answer, line in zip(got, (line for line in kept if line["answer"]), strict=True):
        expected = line["answer"]
        assert answer.keys() == expected.keys()
        assert answer["timestamp"] == pytest.approx(expected["timestamp"], abs=1e-12)
        for name in ("position", "quaternion", "velocity"):
            np.testing.assert_allclose(answer[name], expected[name], rtol=0.0, atol=1e-12)
        # The acceleration is a difference of velocities over 2.5 ms.
        for name in ("gyro", "accel_body"):
            np.testing.assert_allclose(answer["imu"][name], expected["imu"][name], rtol=0.0, atol=1e-9)
    assert (vehicle.lost, vehicle.repeated, vehicle.strange, vehicle.starts) == (3, 1, 3, 2)


def test_a_silent_autopilot_ends_the_wait(vehicle):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        door.bind(("127.0.0.1", 0))
        door.settimeout(0.05)
        BRIDGE.serve(vehicle, door)
    assert vehicle.starts == 0


def test_frames_make_time(vehicle):
    times = [told(vehicle, packet(i, STILL))["timestamp"] for i in (7, 8, 8, 9, 12, 3, 4)]
    assert np.allclose(np.array(times) * vehicle.rate, [1, 2, 2, 3, 4, 1, 2], rtol=0.0, atol=1e-9)
    assert (vehicle.lost, vehicle.repeated, vehicle.starts) == (2, 1, 2)


def test_a_repeated_frame_has_the_same_answer(vehicle):
    first = vehicle.answer(packet(5, pulses(4, 200)))
    assert vehicle.answer(packet(5, pulses(0, -300))) == first


def test_a_new_start_is_the_first_one_again(vehicle):
    runs = [[vehicle.answer(packet(i, pulses(1, 150))) for i in range(5)] for _ in range(2)]
    assert runs[0] == runs[1]


def test_a_still_vehicle_feels_its_weight_less_its_fall(vehicle):
    """A vehicle heavier than the water falls by (W - B) / (m + m_z) at first, and accelerometers feel that less gravity."""
    answer = told(vehicle, packet(0, STILL))
    body = lw.Scene.named("bluerov2_heavy").vehicle
    fall = (body.mass * vehicle.gravity[2] - body.buoyancy) / (body.mass + body.added_mass[2, 2])
    # The drag at the end of the first 2.5 ms: (33 kg/s) (0.076 mm/s) / (32 kg).
    assert np.allclose(answer["imu"]["accel_body"], [0.0, 0.0, fall - vehicle.gravity[2]], rtol=0.0, atol=8e-5)
    assert np.allclose(answer["velocity"], [0.0, 0.0, fall / vehicle.rate], rtol=0.0, atol=1e-6)


def test_gyroscopes_and_velocities_are_those_of_the_motion(vehicle):
    """Rates and velocities beside central differences of attitudes and positions, while it turns about two axes and rises."""
    channels = pulses(2, 200)[:4] + np.add(pulses(1, 100), np.subtract(pulses(3, 100), 1500))[4:].tolist()
    answers, T = [told(vehicle, packet(i, channels)) for i in range(200)], 1.0 / vehicle.rate
    for k in range(50, 199, 20):
        near = answers[k - 1 : k + 2]
        turned = rotation(near[0]["quaternion"]).T @ rotation(near[2]["quaternion"])
        vector = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / 2.0
        sine = np.linalg.norm(vector)
        rates = vector / sine * np.arcsin(sine) / (2.0 * T)
        moved = (np.array(near[2]["position"]) - near[0]["position"]) / (2.0 * T)
        for found, numbers in ((rates, [a["imu"]["gyro"] for a in near]), (moved, [a["velocity"] for a in near])):
            first, middle, last = np.array(numbers)
            # Differences of the second order: a sixth of the second difference by the rule, a twelfth by the method; and the
            # axes turn meanwhile.
            bound = 0.3 * np.linalg.norm(first - 2.0 * middle + last) + T**2 * np.linalg.norm(rates) ** 3
            assert np.linalg.norm(found - middle) < bound
    assert np.all(np.abs(answers[-1]["imu"]["gyro"])[1:] > 0.05)


@pytest.mark.parametrize("which, sign, read", [
    (0, 1, lambda a: a["imu"]["gyro"][0]), (1, 1, lambda a: a["imu"]["gyro"][1]), (2, 1, lambda a: a["imu"]["gyro"][2]),
    (3, -1, lambda a: a["velocity"][2]), (4, 1, lambda a: a["velocity"][0]), (5, 1, lambda a: a["velocity"][1]),
], ids=["roll", "pitch", "yaw", "up", "ahead", "starboard"])  # fmt: skip
def test_motors_do_what_ardusub_means(vehicle, which, sign, read):
    """Each motion that ArduSub asks of its motors, and its opposite, less what a still vehicle does."""
    moved = []
    for size in (200, 0, -200):
        vehicle.frame = None
        moved.append(read([told(vehicle, packet(i, pulses(which, size))) for i in range(40)][-1]))
    assert sign * (moved[0] - moved[1]) > 0.01
    assert sign * (moved[1] - moved[2]) > 0.01


def test_channels_that_are_off_do_nothing(vehicle):
    off, middle = (told(vehicle, packet(i, [value] * 16)) for i, value in ((9, 0), (1, 1500)))
    assert off == middle


def test_pulses_beyond_their_range_are_those_at_its_end(vehicle):
    far, end = (told(vehicle, packet(i, [1500] * 4 + [value] * 12)) for i, value in ((9, 65535), (1, 1900)))
    assert far == end


@pytest.mark.parametrize(
    "sent", [b"", b"\x1a", packet(1, STILL)[:-1], packet(1, STILL) + b"x", packet(1, STILL, magic=1)]
)
def test_strange_packets_have_no_answer(vehicle, sent):
    assert vehicle.answer(sent) is None
    assert vehicle.strange == 1


@pytest.mark.ci
def test_it_is_the_run_of_the_same_commands(vehicle):
    """`lw.solve` with the same commands from Python: the same bits."""
    sent = pulses(4, 120)
    last = [told(vehicle, packet(i, sent)) for i in range(80)][-1]
    commands = -(np.array(sent[:8]) - 1500.0) / 400.0
    law = lw.control.Callback(partial(held, commands), to="thrusters")
    controller = lw.Controller(period=1.0 / vehicle.rate, laws=[law])
    scene = lw.Scene.named("bluerov2_heavy", start={"position": BRIDGE.START}, controller=controller)
    result = lw.solve(scene, "psi_x", h=1.0 / vehicle.rate, t1=80.0 / vehicle.rate, save=lw.SaveAt())
    assert np.array_equal(result.position[-1, 0], last["position"])
    assert np.array_equal(result.angular_velocity[-1, 0], last["imu"]["gyro"])


def held(commands, t, y, r, members):
    return np.tile(commands, (len(members), 1))


def test_a_vehicle_that_fails_is_put_back_to_its_start(vehicle, monkeypatch):
    told(vehicle, packet(0, pulses(4, 200)))
    monkeypatch.setattr(vehicle.env, "step", lambda commands: (np.zeros((1, 18)), 0.0, np.array([True]), None, {}))
    answer = told(vehicle, packet(1, pulses(4, 200)))
    assert answer["timestamp"] == 0.0
    assert answer["position"] == list(BRIDGE.START)
    assert answer["imu"]["accel_body"] == [0.0, 0.0, -vehicle.gravity[2]]
    assert vehicle.starts == 2


@pytest.mark.parametrize("port", ["here", "70000", "-1"])
def test_a_wrong_port_is_told_in_a_line(port):
    command = [sys.executable, ROOT / "examples" / "bridges" / "ardupilot_json.py", port]
    told_of = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert told_of.returncode == 1
    assert told_of.stderr == f"port = {port!r} is not a port. Give a number from 1 to 65535, such as 9002\n"


def test_the_mixing_is_complete():
    """Eight motors that can make all six motions."""
    assert np.linalg.matrix_rank(np.array(servo_packets.MIXING)) == 6
