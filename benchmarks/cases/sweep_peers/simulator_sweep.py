# SPDX-License-Identifier: Apache-2.0
"""The sweep by hand as a loop over the members of auv_sim_bench, one vehicle after the other; its axes are x, left, up."""

import numpy as np
from auv_sim_bench.dynamics import AUVDynamics, AUVParams, AUVState, quat_to_rot

from benchmarks.cases.sweep_peers import by_hand

TURN = np.array([1.0, -1.0, -1.0])  # of its axes to ours, in the world and in the body


def law(state, R, gains):
    """The command (6,) of a tick, in our axes."""
    c, s = np.cos(by_hand.HEADING), np.sin(by_hand.HEADING)
    wanted = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    error = 0.5 * np.cross(R, wanted).sum(axis=0)
    force = R.T @ (gains["kp"] * (by_hand.GOAL - TURN * state.p)) - gains["kd"] * (TURN * state.v)
    torque = -gains["kr"] * error - gains["kw"] * (TURN * state.w)
    return np.clip(np.concatenate([force, torque]), -by_hand.LIMIT, by_hand.LIMIT)


def run(buoyancy, current, gains, delay, parts):
    """The path of a member in one cell, as `metrics_of` takes it."""
    numbers, state, late = AUVParams(), AUVState(), round(delay / by_hand.PERIOD)
    numbers.mass, numbers.inertia, numbers.gravity = by_hand.MASS, by_hand.INERTIA, by_hand.GRAVITY
    numbers.volume = buoyancy / (numbers.water_density * by_hand.GRAVITY)
    numbers.cob_offset = np.array([0.0, 0.0, -by_hand.LEVER])
    numbers.lin_drag, numbers.ang_drag = by_hand.LINEAR[:3], by_hand.LINEAR[3:]
    numbers.quad_drag, numbers.ang_quad_drag = by_hand.QUADRATIC[:3], by_hand.QUADRATIC[3:]
    numbers.current_world = TURN * current
    simulator = AUVDynamics(numbers, state)
    place, attitude, command = [], [], []
    for tick in range(by_hand.TICKS + 1):
        place.append(TURN * state.p)
        attitude.append(TURN[:, None] * quat_to_rot(state.q) * TURN)
        command.append(law(state, attitude[-1], gains))
        wrench = command[tick - late] if tick >= late else np.zeros(6)
        for _ in range(by_hand.EVERY * parts if tick < by_hand.TICKS else 0):
            simulator.step(by_hand.STEP / parts, TURN * wrench[:3], TURN * wrench[3:])
    return np.array(place), np.array(attitude), np.array(command[:-1])


def sweep(members, parts=1):
    """Metrics by cell, and the answer; members: buoyancy (n,) [N], current (n, 3) [m/s]; parts: steps in one of ours."""
    cells = {}
    for case, delay in by_hand.CELLS:
        pairs = zip(members["buoyancy"], members["current"], strict=True)
        paths = zip(*(run(*pair, by_hand.GAINS[case], delay, parts) for pair in pairs), strict=True)
        cells[case, delay] = by_hand.metrics_of(*(np.stack(path, axis=-1) for path in paths))
    return cells, by_hand.answer(cells)
