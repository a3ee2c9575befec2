# SPDX-License-Identifier: Apache-2.0
"""Servo packets as ArduPilot's JSON interface describes them, and an exchange that is kept.

`python -m tests.support.servo_packets` writes it.
No ArduPilot sent them: they follow its description (libraries/SITL/examples/JSON/readme.md), and its mixing of motors for the
frame vectored_6dof (libraries/AP_Motors/AP_Motors6DOF.cpp).
"""

import json
import struct

from tests.conftest import ROOT
from tests.support.bridges import example

KEPT = ROOT / "tests" / "data" / "ardupilot_exchange.jsonl"
# What each motor does by a longer pulse: roll, pitch, yaw, up, ahead, to starboard.
MIXING = (
    (0, 0, 1, 0, -1, 1),
    (0, 0, -1, 0, -1, -1),
    (0, 0, -1, 0, 1, 1),
    (0, 0, 1, 0, 1, -1),
    (1, -1, 0, -1, 0, 0),
    (-1, -1, 0, -1, 0, 0),
    (1, 1, 0, -1, 0, 0),
    (-1, 1, 0, -1, 0, 0),
)


def pulses(which, size):
    """Pulses of 16 channels [us] that ask for roll, pitch, yaw, up, ahead or starboard by its number."""
    return [1500 + size * row[which] for row in MIXING] + [1500] * 8


def packet(frame, channels, magic=18458, rate=400):
    return struct.pack(f"<HHI{len(channels)}H", magic, rate, frame, *channels)


def packets():
    """An exchange: still, ahead and turning; one packet twice, three lost, three strange ones, 32 channels, a new start."""
    still, ahead, turning = [1500] * 16, pulses(4, 200), pulses(2, 100)
    sent = [packet(i, still) for i in range(3)]
    sent += [packet(i, ahead) for i in range(3, 12)]
    sent += [packet(11, ahead), packet(15, turning), packet(16, [0] * 16)]
    sent += [packet(17, turning, magic=18459), packet(17, turning)[:39], b""]
    sent += [packet(17, turning + still, magic=29569), packet(0, ahead), packet(1, ahead)]
    return sent


def main():
    """Write the exchange: a line for each packet, with the answer where there is one."""
    vehicle, lines = example("ardupilot_json").Vehicle(), []
    for sent in packets():
        answer = vehicle.answer(sent)
        lines.append(json.dumps({"packet": sent.hex(), "answer": answer and json.loads(answer)}))
    KEPT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
