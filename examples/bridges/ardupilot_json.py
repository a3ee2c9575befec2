# SPDX-License-Identifier: Apache-2.0
"""BlueROV2 heavy for ArduPilot's simulator: its JSON interface, in lockstep over UDP, one vehicle.

    python examples/bridges/ardupilot_json.py [port]

listens on this machine alone, on ArduPilot's port 9002 by default, until it is interrupted. ArduSub is started beside it, in
its own folder, with the frame vectored_6dof and the model JSON:127.0.0.1, and SIM_RATE_HZ as RATE below. Each packet of servo
pulses that arrives makes one period of the vehicle; the answer says where it then is. docs/controllers/bring_your_own_loop.md
explains it. The protocol: ArduPilot, libraries/SITL/examples/JSON/readme.md. Needs the extra gym.
"""

import contextlib
import json
import socket
import struct
import sys

import numpy as np

import lgvi_warp as lw

RATE = 400  # periods a second
START = (0.0, 0.0, 5.0)  # m: north, east, down
# Magic number -> servo channels of such a packet: magic, periods a second, count of the frame, pulses [us].
CHANNELS = {18458: 16, 29569: 32}
# A pulse between these is a command between -1 and 1. ArduSub's motors of this frame have the order of the vehicle's thrusters
# and the other sense: its motor 1 pushes astern by a long pulse, thruster 0 ahead by a positive command.
MIDDLE, REACH, SENSE = 1500.0, 400.0, -1.0


def seen(t, y, r):
    """Position, attitude, velocities of the vehicle, as they are."""
    return np.concatenate([y.position, y.attitude.reshape(-1, 9), y.velocity, y.angular_velocity], axis=1)


def by_packets(t, y, r, members):
    """The law of the scene, in whose place the packets are."""
    return np.zeros((len(members), 8))


class Vehicle:
    """One vehicle that packets of servo pulses drive; counts of frames that were lost, repeated or strange."""

    def __init__(self, rate=RATE):
        law = lw.control.Callback(by_packets, to="thrusters")
        controller = lw.Controller(period=1.0 / rate, laws=[law])
        scene = lw.Scene.named("bluerov2_heavy", start={"position": START}, controller=controller)
        settings = dict(act="thrusters", num_envs=1, autoreset_mode="Disabled", method="psi_x", h=1.0 / rate)
        self.env = lw.gym.VectorEnv(scene, observe=seen, **settings)
        self.gravity = np.array([0.0, 0.0, scene.environment.gravity])
        self.rate, self.frame = rate, None
        self.lost = self.repeated = self.strange = self.starts = 0

    def start(self):
        """Put the vehicle where it begins, at rest, with the time at 0."""
        self.starts += 1
        self.note(self.env.reset()[0][0], None)

    def note(self, numbers, before):
        """Take the state from the environment; before: the velocity a period ago [m/s], inertial, or None at rest."""
        self.position, self.attitude = numbers[:3], numbers[3:12].reshape(3, 3)
        self.velocity, self.rates = self.attitude @ numbers[12:15], numbers[15:]
        gained = np.zeros(3) if before is None else (self.velocity - before) * self.rate
        # What accelerometers feel: all forces but the weight, on average over the period.
        self.felt = self.attitude.T @ (gained - self.gravity)

    def move(self, pulses):
        """Make one period with these pulses [us]; 0 is a channel that is off."""
        pulses = np.array(pulses[:8], float)
        commands = np.where(pulses == 0.0, 0.0, SENSE * (pulses - MIDDLE) / REACH)
        numbers, _, ended, _, _ = self.env.step(np.clip(commands, -1.0, 1.0)[None])
        if ended[0]:
            self.start()
        else:
            self.note(numbers[0], self.velocity)

    def answer(self, packet):
        """Answer to a packet of bytes; None for one that is none of ArduPilot's."""
        magic = struct.unpack_from("<H", packet)[0] if len(packet) >= 8 else 0
        if magic not in CHANNELS or len(packet) != 8 + 2 * CHANNELS[magic]:
            self.strange += 1
            return None
        _, _, frame, *pulses = struct.unpack(f"<HHI{CHANNELS[magic]}H", packet)
        if frame == self.frame:
            # It asks again, since the answer was lost: no time has gone by.
            self.repeated += 1
            return self.message()
        if self.frame is None or frame < self.frame:
            self.start()
        else:
            self.lost += frame - self.frame - 1
        self.frame = frame
        self.move(pulses)
        return self.message()

    def message(self):
        """The state as a line of JSON. ArduPilot's reader wants no space in it."""
        state = {
            "timestamp": self.env.time,
            "imu": {"gyro": self.rates.tolist(), "accel_body": self.felt.tolist()},
            "position": self.position.tolist(),
            "quaternion": lw.notation.quaternion_from_matrix(self.attitude).tolist(),
            "velocity": self.velocity.tolist(),
        }
        return f"\n{json.dumps(state, separators=(',', ':'), allow_nan=False)}\n".encode()


def serve(vehicle, door, most=None):
    """Answer packets that come to a socket, without end or so many; a socket with a timeout ends it when nothing comes."""
    count = 0
    while most is None or count < most:
        try:
            packet, sender = door.recvfrom(4096)
        except TimeoutError:
            return
        count += 1
        answer = vehicle.answer(packet)
        if answer is not None:
            door.sendto(answer, sender)


if __name__ == "__main__":
    text = sys.argv[1] if len(sys.argv) > 1 else "9002"
    if not (text.isdecimal() and 0 < int(text) < 65536):
        sys.exit(f"port = {text!r} is not a port. Give a number from 1 to 65535, such as 9002")
    port = int(text)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        try:
            door.bind(("127.0.0.1", port))
        except OSError as error:
            sys.exit(f"port = {port}: {error.strerror}. Give another, or end the program that has it")
        vehicle = Vehicle()
        print(f"BlueROV2 heavy waits for ArduSub on port {port}, {vehicle.rate} periods a second")
        with contextlib.suppress(KeyboardInterrupt):
            serve(vehicle, door)
        told = f"{vehicle.lost} frames lost, {vehicle.repeated} repeated, {vehicle.strange} strange packets"
        print(f"{vehicle.starts} starts, {vehicle.env.time:.3f} s; {told}")
