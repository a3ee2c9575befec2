# SPDX-License-Identifier: Apache-2.0
"""Three coefficients of the REMUS 100 calibrated to a recorded track by Gauss-Newton, with their standard errors.

    python examples/estimates/calibrate_remus.py

The track is a run with other coefficients, by another method and step, through a zigzag of the rudder; fixes of its position
have errors of 5 cm. Each step of Gauss-Newton takes one call of lw.derivatives.
"""

import dataclasses

import numpy as np

import lgvi_warp as lw

# Surge drag X_uu, yaw drag N_rr, and the lift slope of the rudder; what the vehicle that was recorded has.
TRUTH = {"drag_matrix.quadratic[0,0]": 1.75, "drag_matrix.quadratic[5,5]": 80.0, "control_fins.lift_slope[0]": 1.52}
STD = 0.05  # m, of each coordinate of a fix
T1, EVERY = 60.0, 1.0  # s


def scene():
    """The vehicle as published, neutral, with a rudder that goes 5 degrees to one side and then to the other."""
    named = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start={"velocity": [1.5, 0.0, 0.0]})
    angles = np.radians([[0.0, 0.0], [0.0, 0.0], [5.0, 0.0], [5.0, 0.0], [-5.0, 0.0], [-5.0, 0.0]])
    schedule = {"times": [0.0, 5.0, 6.0, 25.0, 26.0, 60.0], "command_schedule": angles}
    terms = [dataclasses.replace(term, **schedule) if term.key == "control_fins" else term for term in named.terms]
    return dataclasses.replace(named, terms=terms)


def fixes(result):
    """Positions at all sample times but the start, (n, 3 k)."""
    return result.position[1:].transpose(1, 0, 2).reshape(result.members, -1)


def recording():
    """Readings of the recorded vehicle's instruments."""
    track = lw.solve(scene().with_numbers(TRUTH), "rk8", h=0.05, t1=T1, save=lw.SaveAt(every=EVERY))
    exact = fixes(track)[0]
    return exact + STD * np.random.default_rng(1).normal(size=exact.shape)


def calibrated(measured, steps=6):
    """Coefficients (k,) whose track is nearest to the fixes, and their covariance (k, k)."""
    model, names = scene(), list(TRUTH)
    at = np.array([model.parameters()["drag_matrix.quadratic"][0, 0], model.parameters()["drag_matrix.quadratic"][5, 5],
                   model.parameters()["control_fins.lift_slope"][0]])  # fmt: skip
    for step in range(steps):
        here = model.with_numbers(dict(zip(names, at, strict=True)))
        found = lw.derivatives(here, fixes, names, method="rk4", h=0.05, t1=T1, save=lw.SaveAt(every=EVERY))
        J, left = found.jacobian, measured - found.value
        print(
            f"step {step}: rms {np.sqrt(np.mean(left**2)):.4f} m, {dict(zip(names, at.round(4).tolist(), strict=True))}"
        )
        change = np.linalg.lstsq(J, left, rcond=None)[0]
        at = at + change
        if np.abs(change / at).max() < 1e-8:
            break
    return at, STD**2 * np.linalg.inv(J.T @ J)


def main():
    """Calibrate, and say how far the coefficients are from those of the vehicle that was recorded."""
    at, covariance = calibrated(recording())
    for name, value, error in zip(TRUTH, at, np.sqrt(np.diag(covariance)), strict=True):
        print(
            f"{name:<28} {value:9.4f} +- {error:.4f}   truth {TRUTH[name]:.4f}, {(value - TRUTH[name]) / error:+.1f} sd"
        )
    return at, covariance


if __name__ == "__main__":
    main()
