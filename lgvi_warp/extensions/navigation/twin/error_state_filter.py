# SPDX-License-Identifier: Apache-2.0
"""An error-state Kalman filter for inertial navigation: Sola 2017, arXiv:1711.02508, chapters 5 and 6."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.extensions.navigation.twin.dvl import beams
from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import heading, turn_to
from lgvi_warp.reference.rotation import Array, exp, hat, norm

# Blocks of the error: position, velocity (inertial), attitude (body axes), biases of accelerometer and gyroscope. Behind them
# are the positions at the ticks of fixes that are on their way.
P, V, THETA, A, W = (slice(3 * i, 3 * i + 3) for i in range(5))
# The square of the bow's level part, up to which it has no heading: 6 degrees from the vertical.
LEVEL = 0.01
# Variance of the rate at a tick, from the means of two periods, over that of a mean.
OF_RATE = 2.5
INNOVATIONS = {"dvl": 0, "fix": 4, "delayed_fix": 7, "depth": 10, "heading": 11}
# Number of the sensor of each innovation.
SENSORS = np.repeat(np.arange(5), (4, 3, 3, 1, 1))


def right_jacobian(w: Array) -> Array:
    """J(w) with Exp(w + d) = Exp(w) Exp(J d) to first order (Sola, eq. 183)."""
    n, H = norm(w), hat(w)
    if n < 1e-4:
        return np.eye(3) - 0.5 * H + H @ H / 6.0
    return np.eye(3) - (1.0 - np.cos(n)) / n**2 * H + (n - np.sin(n)) / n**3 * (H @ H)


class ErrorStateFilter(Part):
    """Numbers of `lw.control.ErrorStateFilter`, and the sensor noise that the filter assumes.

    imu, dvl, depth, heading, fix, delayed_fix: Keys of the sensors in `handed`; "" for none.
    believed: Assumed standard deviations: (3,) each for accelerometer_noise, accelerometer_walk, gyroscope_noise,
    gyroscope_walk, fix, delayed_fix; one number each for dvl, depth, heading. place, dvl_place, fix_place, delayed_fix_place,
    depth_place (3,): Positions of the IMU and of these sensors; dvl_angle [rad].
    latency: Ticks of the delayed fix; copies: Number of fixes that may be pending. errors: (9,) standard normal numbers for
    the error of the first estimate. gate: (5,), for the sensors in the order of INNOVATIONS; None for no gate.
    """

    imu = dvl = depth = heading = fix = delayed_fix = ""
    process_scale = measurement_scale = start_error = 1.0
    place = dvl_place = fix_place = delayed_fix_place = depth_place = np.zeros(3)
    dvl_angle, gravity, latency, copies = np.radians(30.0), 9.81, 0, 1
    most_rejected = 10.0
    gate: Any = None
    errors = np.zeros(9)

    def begin(self) -> None:
        """Begin without an estimate."""
        self.P: Any = None
        self.size = 15 + 3 * self.copies
        self.rejected, self.runs = np.zeros(5), np.zeros(12)
        self.begin_tick()

    def begin_tick(self) -> None:
        """Clear the error state and the innovations."""
        self.x = np.zeros(self.size)
        self.innovation, self.innovation_sigma = np.zeros(12), np.zeros(12)
        self.nis, self.nis_count = 0.0, 0

    def start(self, y: Measurement) -> None:
        """Start at the truth plus errors with the standard deviations that the filter assumes."""
        sigmas = self.position_sigma, self.velocity_sigma, self.attitude_sigma
        error = self.start_error * np.concatenate(sigmas) * self.errors
        p, v, R = self.of_imu(y)
        self.p, self.v, self.R = p + error[P], v + error[V], R @ exp(error[THETA])
        self.a, self.w = np.zeros(3), np.zeros(3)
        self.then, self.sent = np.zeros((self.copies, 3)), np.zeros((self.copies, 3))
        self.rate, self.mean = y.angular_velocity.copy(), y.angular_velocity.copy()
        self.waiting = [-1] * self.copies
        spread = np.concatenate([*sigmas, self.accelerometer_sigma, self.gyroscope_sigma])
        self.P = np.zeros((self.size, self.size))
        self.P[:15, :15] = np.diag(spread**2)

    def of_imu(self, y: Measurement) -> tuple[Array, Array, Array]:
        """Position and velocity of the IMU in inertial axes, and the attitude."""
        v = y.velocity + np.cross(y.angular_velocity, self.place)
        return y.position + y.R @ self.place, y.R @ v, y.R

    def propagate(self, T: float) -> None:
        """Propagate over one period by the IMU's increments (Sola, section 5.4; the position uses the mean velocity)."""
        unit, b = self.handed[self.imu], self.believed
        gained, turned = unit["gained"] - T * self.a, unit["turned"] - T * self.w
        g = np.array([0.0, 0.0, self.gravity])
        F = np.eye(self.size)
        F[V, THETA], F[V, A] = -self.R @ hat(gained), -T * self.R
        F[P, V], F[P, THETA], F[P, A] = T * np.eye(3), 0.5 * T * F[V, THETA], 0.5 * T * F[V, A]
        F[THETA, THETA], F[THETA, W] = exp(turned).T, -T * right_jacobian(turned)
        G = np.zeros((self.size, 12))
        G[V, 0:3], G[P, 0:3], G[THETA, 3:6] = self.R, 0.5 * T * self.R, right_jacobian(turned)
        G[A, 6:9], G[W, 9:12] = np.eye(3), np.eye(3)
        names = ("accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk")
        q = self.process_scale**2 * T * np.concatenate([b[name] for name in names]) ** 2
        self.P = F @ self.P @ F.T + G @ np.diag(q) @ G.T
        v = self.v + self.R @ gained + T * g
        self.p = self.p + 0.5 * T * (self.v + v)
        self.v, self.R = v, self.R @ exp(turned)
        # At the tick: on the line through the means of the last two periods.
        self.rate, self.mean = 1.5 * turned / T - 0.5 * self.mean, turned / T

    def update(self, slot: int, h: Array, difference: float, sigma: float) -> None:
        """Update by one measured number in Joseph's form. difference: Number minus its prediction before all updates."""
        r = (self.measurement_scale * sigma) ** 2
        innovation = float(difference - h @ self.x)
        s = h @ self.P @ h + r
        share = 1.0
        if self.gate is not None:
            g = float(self.gate[SENSORS[slot]])
            if not self.passes(slot, g, h, innovation, r):
                return
            s = h @ self.P @ h + r
            # The mean square of a standard normal that is within the gate.
            inside = math.erf(g / math.sqrt(2.0))
            share = 1.0 - math.sqrt(2.0 / math.pi) * g * math.exp(-0.5 * g**2) / inside if g < 30.0 else 1.0
        k = self.P @ h / s
        J = np.eye(self.size) - np.outer(k, h)
        self.P = J @ self.P @ J.T + r * np.outer(k, k)
        self.x = self.x + k * innovation
        self.innovation[slot], self.innovation_sigma[slot] = innovation, np.sqrt(s)
        self.nis += innovation**2 / (share * s)
        self.nis_count += 1

    def passes(self, slot: int, g: float, h: Array, innovation: float, r: float) -> bool:
        """Whether a number is accepted; after too many rejections in a row it is, and the covariance is enlarged to fit."""
        seen = h @ self.P @ h
        if innovation**2 <= g**2 * (seen + r):
            self.runs[slot] = 0
        elif self.runs[slot] < self.most_rejected:
            self.runs[slot] += 1
            self.rejected[SENSORS[slot]] += 1
            return False
        else:
            self.runs[slot] = 0
            wanted = innovation**2 / g**2 - r
            along = self.P @ h
            self.P = self.P + (wanted - seen) / seen**2 * np.outer(along, along)
        return True

    def by_position(self, now: slice, i: int, place: Array) -> Array:
        """Row from the error to coordinate i of the position of `place`; `now`: the present position or a fix's copy."""
        h = np.zeros(self.size)
        h[now.start + i] = 1.0
        if now == P:
            h[THETA] = (self.R @ hat(self.place - place))[i]
        return h

    def at(self, place: Array) -> Array:
        """The position (3,) in inertial axes of a sensor at `place`."""
        return self.p + self.R @ (place - self.place)

    def by_beam(self, u: Array) -> tuple[float, Array]:
        """The velocity along a beam, and the row from the error to it."""
        V_body, arm, h = self.R.T @ self.v, self.dvl_place - self.place, np.zeros(self.size)
        h[V], h[THETA], h[W] = self.R @ u, np.cross(u, V_body), np.cross(u, arm)
        return float(u @ (V_body + np.cross(self.rate, arm))), h

    def by_heading(self) -> Array:
        """Row that maps the error to the heading."""
        R, h = self.R, np.zeros(self.size)
        h[7:9] = R[0, 0] * R[1, 2] - R[1, 0] * R[0, 2], R[0, 0] * R[1, 1] - R[1, 0] * R[0, 1]
        h[7] = -h[7]
        return h / (R[0, 0] ** 2 + R[1, 0] ** 2)

    def correct(self, y: Measurement) -> None:
        """Update by all readings of this tick, one number after another."""
        self.begin_tick()
        if self.dvl:
            read = self.handed[self.dvl]
            for i, u in enumerate(beams(self.dvl_angle)):
                expected, h = self.by_beam(u)
                # That of the rate, by the means of two periods, too.
                swing = OF_RATE / y.period * (self.process_scale * self.believed["gyroscope_noise"] * h[W]) ** 2
                sigma = np.sqrt(self.believed["dvl"] ** 2 + swing.sum() / self.measurement_scale**2)
                if read["fresh"][i]:
                    self.update(i, h, read["along"][i] - expected, sigma)
        if self.fix and self.handed[self.fix]["fresh"]:
            for i in range(3):
                difference = self.handed[self.fix]["values"][i] - self.at(self.fix_place)[i]
                h = self.by_position(P, i, self.fix_place)
                self.update(INNOVATIONS["fix"] + i, h, difference, self.believed["fix"][i])
        if self.delayed_fix:
            self.correct_by_delayed()
        if self.depth and self.handed[self.depth]["fresh"]:
            difference = self.handed[self.depth]["values"][0] - self.at(self.depth_place)[2]
            h = self.by_position(P, 2, self.depth_place)
            self.update(INNOVATIONS["depth"], h, difference, self.believed["depth"])
        # Where the bow is nearly vertical it has no heading.
        if self.heading and self.handed[self.heading]["fresh"] and np.sum(self.R[:2, 0] ** 2) > LEVEL:
            difference = self.handed[self.heading]["values"][0] - heading(self.R)
            difference -= 2.0 * np.pi * np.rint(difference / (2.0 * np.pi))
            self.update(INNOVATIONS["heading"], self.by_heading(), difference, self.believed["heading"])
        self.inject()

    def correct_by_delayed(self) -> None:
        """Correct by a delayed fix: copy the position and covariances when it is sent; correct the copy when it arrives.

        This is stochastic cloning (Roumeliotis & Burdick 2002). The first free copy takes a fix; a fix without one is lost.
        """
        read = self.handed[self.delayed_fix]
        new, place = read["fresh"], self.delayed_fix_place
        for c in range(self.copies):
            then = slice(15 + 3 * c, 18 + 3 * c)
            if new and self.waiting[c] < 0:
                # The copy is that of the place where the fix is taken, before the other numbers of this tick.
                copy = np.eye(self.size)
                copy[then] = np.stack([self.by_position(P, i, place) for i in range(3)])
                self.P, self.x = copy @ self.P @ copy.T, copy @ self.x
                self.then[c], self.sent[c], self.waiting[c] = self.at(place), read["values"], self.latency
                new = False
            if self.waiting[c] == 0:
                for i in range(3):
                    slot, difference = INNOVATIONS["delayed_fix"] + i, self.sent[c, i] - self.then[c, i]
                    h = self.by_position(then, i, place)
                    self.update(slot, h, difference, self.believed["delayed_fix"][i])
            if self.waiting[c] >= 0:
                self.waiting[c] -= 1

    def inject(self) -> None:
        """Put the error into the estimate, and turn its covariance with the attitude (Sola, section 6.3)."""
        x = self.x
        self.p, self.v, self.then = self.p + x[P], self.v + x[V], self.then + x[15:].reshape(-1, 3)
        self.a, self.w, self.R = self.a + x[A], self.w + x[W], self.R @ exp(x[THETA])
        self.rate, self.mean = self.rate - x[W], self.mean - x[W]
        G = np.eye(self.size)
        G[THETA, THETA] -= hat(0.5 * x[THETA])
        self.P = G @ self.P @ G.T

    def error(self, y: Measurement) -> Array:
        """The truth minus the estimate (15,)."""
        p, v, R = self.of_imu(y)
        unit = self.handed[self.imu]
        biases = unit["bias_a"] - self.a, unit["bias_w"] - self.w
        return np.concatenate([p - self.p, v - self.v, turn_to(self.R, R), *biases])

    def measure(self, y: Measurement) -> Measurement:
        """Replace the measured position, attitude, velocity and angular velocity by the estimate."""
        if self.P is None:
            self.start(y)
        else:
            self.propagate(y.period)
        self.correct(y)
        e = self.error(y)
        self.nees = float(e @ np.linalg.solve(self.P[:15, :15], e))
        self.sigma = np.sqrt(np.diag(self.P)[:15])
        velocity = self.R.T @ self.v - np.cross(self.rate, self.place)
        return replace(
            y,
            position=self.p - self.R @ self.place,
            R=self.R.copy(),
            velocity=velocity,
            angular_velocity=self.rate.copy(),
        )
