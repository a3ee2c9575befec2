# SPDX-License-Identifier: Apache-2.0
"""Righting, running and turning of the package's vehicles: commands, and one run of each.

`python benchmarks/named_vehicles.py NAME picture.png` draws a vehicle's turn from above and how it rights itself.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))

import lgvi_warp as lw  # noqa: E402

ANGLE = np.radians(20.0)
DEPTH = 500.0  # m, where nothing reaches the surface
# In inches; at 100 pixels to the inch as wide as a page's column, and drawn twice as fine.
SIZE, FINE = (8.38, 3.6), 200


class Trial(NamedTuple):
    """Trial of a vehicle.

    Attributes:
        t1: How long it runs [s].
        step: Of rk4 [s].
        still: Parameters of a member that is left alone, by name.
        ahead: Those of one that runs ahead, where they differ.
        turn: Those of one that turns, where they differ from `ahead`.
        speed: Ahead, at the start of runs ahead and turns [m/s].
        words: What the commands of the run ahead and of the turn are.
    """

    t1: float
    step: float
    still: dict[str, Any]
    ahead: dict[str, Any]
    turn: dict[str, Any]
    speed: float
    words: tuple[str, str]


def turns_of(thrust: float, coefficient: float) -> float:
    """The command of a propeller that gives a thrust [N]."""
    return float(np.sqrt(thrust / coefficient))


def level(*thrusts: float) -> list[float]:
    """The commands of the REXROV whose level thrusters give thrusts [N]; those that push astern by themselves count minus."""
    return [0.0] * 4 + [float(np.sign(f)) * turns_of(abs(f), 0.00031) for f in thrusts]


TRIALS = {
    "lauv": Trial(
        120.0, 0.02, {"thrusters.command": [0.0], "control_fins.command": [0.0] * 4},
        {"thrusters.command": [turns_of(14.0, 0.0002)]},
        {"control_fins.command": [*2 * [np.radians(-10.0)], 0.0, 0.0]}, 1.0,
        ("14 N", "both rudders at 10 degrees"),
    ),
    "eca_a9": Trial(
        120.0, 0.01, {"thrusters.command": [0.0], "control_fins.command": [0.0] * 4},
        {"thrusters.command": [turns_of(32.0, 0.000049)]},
        {"control_fins.command": np.radians([5.0, -5.0, -5.0, 5.0]).tolist()}, 1.0,
        ("32 N", "four fins at 5 degrees"),
    ),
    "girona_500": Trial(
        240.0, 0.02, {"thrusters.command": [0.0] * 5}, {"thrusters.command": [0.5, 0.5, 0.0, 0.0, 0.0]},
        {"thrusters.command": [0.5, 0.25, 0.0, 0.0, 0.0]}, 0.5,
        ("half of both surge thrusters", "half of the port one, a quarter of the other"),
    ),
    "rexrov": Trial(
        240.0, 0.02, {"thrusters.command": [0.0] * 8}, {"thrusters.command": level(300.0, 300.0, -300.0, -300.0)},
        {"thrusters.command": level(300.0, 100.0, -100.0, -300.0)}, 0.5,
        ("300 N of each level thruster", "300 N of two level thrusters, 100 N of the others"),
    ),
    "dsrv": Trial(
        300.0, 0.02, {"wrench.force": [0.0] * 3, "control_fins.command": [0.0, 0.0]},
        {"wrench.force": [322.0846433879751, 0.0, 0.0]}, {"control_fins.command": [np.radians(-5.0), 0.0]}, 4.0,
        ("322 N", "rudder at 5 degrees"),
    ),
}  # fmt: skip
MEMBERS = ("rolled", "pitched", "free", "ahead", "turn", "neutral")


class Run(NamedTuple):
    """Motion of a vehicle: `member` of MEMBERS, then time.

    Attributes:
        time: (n,) [s].
        position: (n, 6, 3) [m].
        attitude: (n, 6, 3, 3).
        velocity: (n, 6, 6) [m/s, rad/s], in body axes.
    """

    time: np.ndarray
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray

    def angle(self, member: str) -> np.ndarray:
        """Roll of the member that was rolled, pitch of the one that was pitched, less where one left alone ends (n,) [rad]."""
        R = self.attitude[:, MEMBERS.index(member)]
        roll, pitch = self.end("free")[3:5]
        return np.arctan2(R[:, 2, 1], R[:, 2, 2]) - roll if member == "rolled" else -np.arcsin(R[:, 2, 0]) - pitch

    def end(self, member: str) -> np.ndarray:
        """At the end: nu (3,), roll, pitch, and the rate about the vertical: the unknowns of a steady turn."""
        which = MEMBERS.index(member)
        R, v = self.attitude[-1, which], self.velocity[-1, which]
        down = R[2]
        return np.array([*v[:3], np.arctan2(down[1], down[2]), -np.arcsin(down[0]), v[3:] @ down])

    def over_ground(self, member: str) -> tuple[float, float]:
        """Its level speed and its speed down at the end [m/s]."""
        which = MEMBERS.index(member)
        north_east_down = self.attitude[-1, which] @ self.velocity[-1, which, :3]
        return float(np.hypot(*north_east_down[:2])), float(north_east_down[2])


def parameters(name: str) -> dict[str, np.ndarray]:
    """The parameters of the six members by name."""
    trial = TRIALS[name]
    still, ahead = trial.still, trial.still | trial.ahead
    rows = (still, still, still, ahead, ahead | trial.turn, ahead)
    vehicle = lw.Scene.named(name).vehicle
    forces = [*5 * [vehicle.buoyancy], vehicle.weight]
    return {"vehicle.buoyancy": np.array(forces)} | {key: np.array([row[key] for row in rows]) for key in still}


def run(name: str, step: float | None = None, t1: float | None = None) -> Run:
    """Run the six members of a vehicle. step, t1: those of its trial by default."""
    trial, R = TRIALS[name], np.tile(np.eye(3), (6, 1, 1))
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    R[0] = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    R[1] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    nu, zero = np.zeros((6, 3)), np.zeros((6, 3))
    nu[3:, 0] = trial.speed
    at = np.tile([0.0, 0.0, DEPTH], (6, 1))
    fleet = lw.Ensemble.from_states(lw.Scene.named(name), at, R, nu, zero, parameters(name))
    h = step or trial.step
    save = lw.SaveAt(every=max(0.02, h), fields=("position", "attitude", "velocity", "angular_velocity"))
    result = lw.solve(fleet, "rk4", h=h, t1=t1 or trial.t1, save=save, threads=1)
    assert result.status.counts() == {"ok": 6}
    v = np.concatenate([result.velocity, result.angular_velocity], axis=-1)
    return Run(np.asarray(result.time), result.position, result.attitude, v)


def righting(time: np.ndarray, angle: np.ndarray) -> str:
    """Sentence on the return of an angle (n,) [rad] at times (n,) [s]."""
    turned = np.flatnonzero(np.diff(np.sign(angle)) != 0)
    peaks = [np.abs(angle[a:b]).max() for a, b in zip(turned, turned[1:], strict=False) if b > a]
    swings = [peak for peak in peaks if peak > 0.01 * ANGLE]
    if len(swings) < 2:
        within = time[np.flatnonzero(np.abs(angle) > 0.05 * ANGLE)[-1]]
        return f"within 1 degree after {within:.2g} s"
    cross = time[turned] - angle[turned] * np.diff(time)[turned] / np.diff(angle)[turned]
    period = 2.0 * (cross[2] - cross[0]) / 2.0
    left = peaks[1] / ANGLE
    decay = "no decay" if left > 0.99 else f"{100.0 * left:.0f} % left after it"
    return f"period {period:.3g} s, {decay}"


def draw(name: str, file: str) -> None:
    """Draw a vehicle's way ahead and its turn from above, and its angles after a release."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    ran, trial = run(name), TRIALS[name]
    with plt.rc_context({"font.size": 12, "axes.titlesize": 12}):
        figure, (path, angles) = plt.subplots(1, 2, figsize=SIZE, layout="constrained")
        for member, color, label in (("ahead", "#8f9aa6", "ahead"), ("turn", "#0072b2", "turn")):
            shown = (ran.time <= seen(ran, trial)) & near(ran, member)
            north, east, _ = ran.position[shown, MEMBERS.index(member)].T
            path.plot(east, north, color=color, label=label)
        path.plot(0.0, 0.0, "o", color="#333333", markersize=5, label="start")
        path.set(xlabel="east [m]", ylabel="north [m]", title="from above")
        path.set_aspect("equal", "datalim")
        path.margins(0.12)
        path.legend(frameon=False, loc="best")
        shown = ran.time <= shortest(ran)
        for member, color, label, dashes in (("rolled", "#d55e00", "roll", "-"), ("pitched", "#0072b2", "pitch", "--")):
            angles.plot(ran.time[shown], np.degrees(ran.angle(member)[shown]), dashes, color=color, label=label)
        angles.axhline(0.0, color="#8f9aa6", linewidth=0.8)
        low, high = angles.get_ylim()
        angles.set(xlabel="time [s]", ylabel="angle [degrees]", title="released at 20 degrees")
        angles.set_ylim(low, high + 0.2 * (high - low))
        angles.legend(frameon=False, ncols=2, loc="upper right")
        figure.savefig(file, dpi=FINE)


def seen(ran: Run, trial: Trial) -> float:
    """Shown time of the paths [s]: about a turn and a third."""
    return float(min(trial.t1, 2.7 * np.pi / abs(ran.end("turn")[5])))


def near(ran: Run, member: str) -> np.ndarray:
    """Whether a member is still within two circles' breadth of its start (n,): the way ahead is shown no longer."""
    circle = 2.0 * ran.over_ground("turn")[0] / abs(ran.end("turn")[5])
    away = np.linalg.norm(ran.position[:, MEMBERS.index(member), :2], axis=-1)
    return np.logical_and.accumulate(away < 2.0 * circle) if member == "ahead" else np.full(len(away), True)


def shortest(ran: Run) -> float:
    """Shown time of the angles [s]: until both have come back, 12 s at most."""
    late = [ran.time[np.flatnonzero(np.abs(ran.angle(member)) > 0.05 * ANGLE)[-1]] for member in ("rolled", "pitched")]
    return float(min(1.2 * max(late), 12.0))


if __name__ == "__main__":
    draw(*sys.argv[1:])
