# SPDX-License-Identifier: Apache-2.0
"""Dives and climbs of a Slocum glider in the Baltic: depth rate by its pressure sensor, speed by its Doppler log."""

from typing import Any

import numpy as np
from scipy.optimize import least_squares

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row

TITLE = "Slocum: dives and climbs at sea"
AGAINST = "experiment at sea"
KNOWN = "raw data of the vehicle; spread between legs"
PICTURE = "Speed and depth rate of a Slocum glider on 36 legs, as computed and as measured"
HEADLINE = "speed through the water, mean of 17 dives"
SCENES = ("examples/validation/slocum_comet.toml", "examples/validation/slocum_comet.csv")
GRAVITY, VOLUME, COMPRESSIBILITY = 9.81, 70.0 / 1004.0, 5e-10  # m/s2, m3, 1/Pa
MIDDLE, PRESSURE = 23.5, 1004.0 * 9.81 * 23.5  # m, Pa: of the straight line of the density
FITTED = 10  # legs: five dives and five climbs
BEFORE = 30.0  # s: computed before what is compared, for the glide to become steady


def legs() -> Any:
    """Measurements, one record for each leg."""
    return np.genfromtxt(ROOT / SCENES[1], delimiter=",", names=True, skip_header=5)


def buoyancies(measured: Any) -> Any:
    """Buoyancy of each leg at the middle depth [N]."""
    volume = VOLUME * (1.0 - COMPRESSIBILITY * PRESSURE) + 1e-6 * measured["buoyancy_cm3"]
    return GRAVITY * measured["density_kg_m3"] * volume


def flown(known: Any, more: dict[str, Any] | None = None) -> tuple[Any, Any]:
    """Run legs as the members of one ensemble.

    Args:
        known: The legs.
        more: Numbers of the scene that are replaced.

    Returns:
        Mean speed [m/s] and depth rate [m/s] of each leg over the time of its measurement.
    """
    scene = lw.Scene.load(ROOT / SCENES[0]).with_numbers(more or {})
    pitch, n = np.radians(known["pitch_deg"]), len(known)
    R = np.zeros((n, 3, 3))
    R[:, 0, 0] = R[:, 2, 2] = np.cos(pitch)
    R[:, 0, 2], R[:, 2, 0], R[:, 1, 1] = np.sin(pitch), -np.sin(pitch), 1.0
    position = np.zeros((n, 3))
    position[:, 2] = known["first_depth_m"] - BEFORE * known["depth_rate_m_s"]
    given = {
        "vehicle.buoyancy": buoyancies(known),
        "stratification.gradient": known["density_gradient_kg_m4"] / known["density_kg_m3"],
    }
    fleet = lw.Ensemble.from_states(scene, position, R, np.tile([0.3, 0.0, 0.0], (n, 1)), np.zeros((n, 3)), given)
    end = np.ceil(BEFORE + known["duration_s"].max())
    result = lw.solve(fleet, scene.run.method, h=scene.run.step, t1=end, save=lw.SaveAt(every=1.0))
    t, speeds, rates = result.time, np.zeros(n), np.zeros(n)
    for i, leg in enumerate(known):
        late = (t >= BEFORE) & (t <= BEFORE + leg["duration_s"])
        speeds[i] = np.linalg.norm(result.velocity[late, i], axis=1).mean()
        rates[i] = np.polyfit(t[late], result.position[late, i, 2], 1)[0]
    return speeds, rates


def fit() -> tuple[float, float]:
    """Fit mass [kg] and drag [kg/m] to the depth rates of the first legs; no speed is used."""
    known = legs()[:FITTED]

    def misses(unknown: Any) -> Any:
        numbers = {"vehicle.mass": 70.0 + 0.1 * unknown[0], "polar.drag": 7.5 * unknown[1]}
        return flown(known, numbers)[1] - known["depth_rate_m_s"]

    mass, drag = least_squares(misses, (1.0, 1.0), diff_step=1e-3).x
    return 70.0 + 0.1 * mass, 7.5 * drag


def measured() -> Content:
    """Run all legs."""
    known = legs()
    speeds, rates = flown(known)
    dives, later = known["depth_rate_m_s"] > 0.0, np.arange(len(known)) >= FITTED
    told = dives.copy()
    told[np.flatnonzero(dives)[-1]] = False
    rows = [
        _mean(HEADLINE, known["speed_m_s"], speeds, told),
        _mean("depth rate, mean of 13 dives", known["depth_rate_m_s"], rates, dives & later),
        _mean("depth rate, mean of 13 climbs", known["depth_rate_m_s"], rates, ~dives & later),
        Row("speed, the first dive", "m/s", known["speed_m_s"][0], None, speeds[0]),
        Row("speed, the last dive", "m/s", known["speed_m_s"][dives][-1], None, speeds[dives][-1]),
        Row("rms difference of a dive's speed, of 17", "m/s", 0.0, None, _rms(speeds - known["speed_m_s"], told)),
        Row(
            "rms difference of a leg's depth rate, of 26",
            "m/s",
            0.0,
            None,
            _rms(rates - known["depth_rate_m_s"], later),
        ),
    ]
    start = known["start_s"]
    curves = {
        "speed, measured": (start[dives].tolist(), known["speed_m_s"][dives].tolist()),
        "speed, computed": (start[dives].tolist(), speeds[dives].tolist()),
    }
    for name, chosen in (("dives", dives), ("climbs", ~dives)):
        at = start[chosen].tolist()
        curves[f"rate, measured, {name}"] = (at, np.abs(known["depth_rate_m_s"][chosen]).tolist())
        curves[f"rate, computed, {name}"] = (at, np.abs(rates[chosen]).tolist())
    return Content(rows, curves)


def _mean(what: str, known: Any, computed: Any, chosen: Any) -> Row:
    """Row of the mean over chosen legs; its uncertainty is the standard deviation between them."""
    return Row(what, "m/s", known[chosen].mean(), known[chosen].std(ddof=1), computed[chosen].mean())


def _rms(differences: Any, chosen: Any) -> float:
    """Row of the root mean square over chosen legs."""
    return float(np.sqrt(np.mean(differences[chosen] ** 2)))


def draw(content: Content, figure: Any) -> None:
    """Speed of each dive, and depth rate of each leg."""
    speed, rate = figure.subplots(1, 2)
    speed.plot(*content.curves["speed, measured"], "o", color=PUBLISHED, label="measured by the Doppler log")
    speed.plot(
        *content.curves["speed, computed"], "_", color=COMPUTED, markersize=14, markeredgewidth=2.5, label="computed"
    )
    speed.set(xlabel="time of the dive [s]", ylabel="speed through the water [m/s]", ylim=(0.18, 0.36))
    speed.legend(loc="lower left")
    for name, marker in (("climbs", "^"), ("dives", "v")):
        rate.plot(*content.curves[f"rate, measured, {name}"], marker, color=PUBLISHED, label=f"measured, {name}")
        rate.plot(*content.curves[f"rate, computed, {name}"], "_", color=COMPUTED, markersize=14, markeredgewidth=2.5)
    rate.plot([], [], "_", color=COMPUTED, markersize=14, markeredgewidth=2.5, label="computed")
    rate.axvspan(0.0, 3600.0, color="0.93", zorder=0)
    rate.text(200.0, 0.1375, "mass and\ndrag fitted\nto these", color="0.4")
    rate.set(
        xlabel="time of the leg [s]", ylabel="depth rate, either way [m/s]", ylim=(0.12, 0.155), xlim=(0.0, 15000.0)
    )
    rate.legend(loc="center right")
