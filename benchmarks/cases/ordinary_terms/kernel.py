# SPDX-License-Identifier: Apache-2.0
"""The peer with all terms: an ordinary Warp kernel, one vehicle a thread, as a competent Warp user would write it.

wp.mat33 and wp.vec3 throughout, tables as wp.arrays, Warp's own elementary functions and random numbers, equation (24) by
the paper's Newton iteration on the exponential map to a tolerance, 6x6 systems by elimination of 3x3 blocks, Warp's default
module options. It makes psi_s with the laws of benchmarks.problems.all_terms() for a vehicle with M and J uncoupled.
"""

import functools
import math

import numpy as np
import warp as wp

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
THRUSTERS, CONTROL_FINS = 4, 2


@functools.cache
def make_ordinary(real):
    """(kernel, struct of its parameters) in wp.float64 or wp.float32."""
    mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)
    thrusts, angles = wp.types.vector(THRUSTERS, real), wp.types.vector(CONTROL_FINS, real)
    tolerance = 1e-14 if real == wp.float64 else 1e-6
    numbers, numbers2, vectors = wp.array(dtype=real), wp.array2d(dtype=real), wp.array(dtype=vec3)

    @wp.struct
    class Parameters:
        M: mat33
        M_inverse: mat33
        J: mat33
        J_inverse: mat33
        net: real
        moment: vec3
        excess: real
        excess_lever: vec3
        mass: real
        added: mat33
        # drag: linear and quadratic matrices as blocks
        linear_11: mat33
        linear_12: mat33
        linear_21: mat33
        linear_22: mat33
        quadratic_11: mat33
        quadratic_12: mat33
        quadratic_21: mat33
        quadratic_22: mat33
        # currents
        current: vec3
        profile_depth: numbers
        profile_velocity: vectors
        harmonic_amplitude: vectors
        harmonic_omega: numbers
        harmonic_phase: numbers
        wave_direction: vectors
        wave_number: numbers
        wave_omega: numbers
        wave_speed: numbers
        wave_phase: numbers
        markov_decay: real
        markov_spread: vec3
        # tether
        anchor: vec3
        attachment: vec3
        stiffness: real
        rest_length: real
        # wrenches
        force: vec3
        torque: vec3
        schedule_time: numbers
        schedule_force: vectors
        schedule_torque: vectors
        noise_force: vec3
        noise_torque: vec3
        # thrusters; lag: what is left of the distance to the command after half a step; delay: time constant over half a step
        thruster_direction: vectors
        thruster_arm: vectors
        thruster_ahead: numbers
        thruster_astern: numbers
        thruster_band: numbers
        thruster_limit: numbers
        thruster_lag: numbers
        thruster_delay: numbers
        thruster_time: numbers
        thruster_command: numbers2
        # fins, the fixed ones and then those that turn: half_area is rho A / 2
        fin_chord: vectors
        fin_chord_arm: vectors
        fin_normal: vectors
        fin_normal_arm: vectors
        fin_lift: numbers
        fin_drag: numbers
        fin_drag_normal: numbers
        fixed_fins: int
        rudder_limit: numbers
        rudder_rate: numbers
        rudder_time: numbers
        rudder_command: numbers2
        # hull: strips across the flow
        strip_station: numbers
        strip_strength: numbers
        # lift by blocks
        lift_11: mat33
        lift_12: mat33
        lift_21: mat33
        lift_22: mat33
        # stratification
        strata_stiffness: real
        strata_center: vec3
        strata_depth: real

    @wp.struct
    class Flow:
        velocity: vec3
        rate: vec3
        gradient: mat33

    @wp.struct
    class Wrench:
        force: vec3
        torque: vec3

    @wp.struct
    class Damping:
        D11: mat33
        D12: mat33
        D21: mat33
        D22: mat33

    @wp.struct
    class Factor:
        inverse: mat33
        upper: mat33
        lower: mat33
        schur: mat33

    @wp.func
    def equation_24(a: vec3, J: mat33, J_inverse: mat33):
        """F = exp(hat(f)), sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f = a, by Newton-Raphson (section III-G)."""
        f = J_inverse * a
        alpha = real(1.0)
        beta = real(0.5)
        for _ in range(20):
            n2 = wp.dot(f, f)
            n = wp.sqrt(n2)
            dalpha = real(-1.0 / 3.0) + n2 * real(1.0 / 30.0)
            dbeta = real(-1.0 / 12.0) + n2 * real(1.0 / 180.0)
            alpha = real(1.0) - n2 * real(1.0 / 6.0)
            beta = real(0.5) - n2 * real(1.0 / 24.0)
            if n > real(1e-3):
                s = wp.sin(n)
                c = wp.cos(n)
                alpha = s / n
                beta = (real(1.0) - c) / n2
                dalpha = (c - alpha) / n2
                dbeta = (alpha - real(2.0) * beta) / n2
            Jf = J * f
            fJf = wp.cross(f, Jf)
            g = alpha * Jf + beta * fJf - a
            if wp.dot(g, g) <= real(wp.static(tolerance * tolerance)) * wp.dot(a, a):
                break
            dG = alpha * J + dalpha * wp.outer(Jf, f) + beta * (wp.skew(f) * J - wp.skew(Jf)) + dbeta * wp.outer(fJf, f)
            f = f - wp.inverse(dG) * g
        hat = wp.skew(f)
        return wp.identity(n=3, dtype=real) + alpha * hat + beta * hat * hat

    @wp.func
    def segment(t: real, times: numbers):
        """The segment of a table that t is in, or the nearest one."""
        last = times.shape[0] - 2
        i = int(0)  # noqa: RUF046, UP018  a variable of the kernel, not a constant
        while i < last and t >= times[i + 1]:
            i += 1
        return i

    @wp.func
    def part(t: real, times: numbers, i: int):
        """Position of t along the segment, 0 to 1."""
        return wp.clamp((t - times[i]) / (times[i + 1] - times[i]), real(0.0), real(1.0))

    @wp.func
    def at_time(t: real, times: numbers, values: vectors):
        """A table of vectors at t."""
        i = segment(t, times)
        s = part(t, times, i)
        return (real(1.0) - s) * values[i] + s * values[i + 1]

    @wp.func
    def thruster_commands(t: real, c: Parameters):
        i = segment(t, c.thruster_time)
        s = part(t, c.thruster_time, i)
        n = thrusts()
        for j in range(wp.static(THRUSTERS)):
            u = (real(1.0) - s) * c.thruster_command[i, j] + s * c.thruster_command[i + 1, j]
            n[j] = wp.clamp(u, -c.thruster_limit[j], c.thruster_limit[j])
        return n

    @wp.func
    def rudder_commands(t: real, c: Parameters):
        i = segment(t, c.rudder_time)
        s = part(t, c.rudder_time, i)
        angle = angles()
        for j in range(wp.static(CONTROL_FINS)):
            u = (real(1.0) - s) * c.rudder_command[i, j] + s * c.rudder_command[i + 1, j]
            angle[j] = wp.clamp(u, -c.rudder_limit[j], c.rudder_limit[j])
        return angle

    @wp.func
    def lagged(n: thrusts, t: real, half: real, c: Parameters):
        """The thrusters' commands at t, half a step after n: exact along a straight command."""
        before = thruster_commands(t - half, c)
        u = thruster_commands(t, c)
        for j in range(wp.static(THRUSTERS)):
            behind = c.thruster_delay[j] * (u[j] - before[j])
            n[j] = u[j] - behind + c.thruster_lag[j] * (n[j] - before[j] + behind)
        return n

    @wp.func
    def steered(angle: angles, t: real, half: real, c: Parameters):
        """The rudders at t, half a step after angle: exact along a straight command that is slower than their rate."""
        u = rudder_commands(t, c)
        for j in range(wp.static(CONTROL_FINS)):
            most = half * c.rudder_rate[j]
            angle[j] = angle[j] + wp.clamp(u[j] - angle[j], -most, most)
        return angle

    @wp.func
    def water(b: vec3, t: real, wander: vec3, wander_rate: vec3, c: Parameters):
        """All currents and waves at b and t."""
        f = Flow()
        f.velocity = c.current + wander
        f.rate = wander_rate
        down = vec3(real(0.0), real(0.0), real(1.0))
        depth = b[2]
        i = segment(depth, c.profile_depth)
        length = c.profile_depth[i + 1] - c.profile_depth[i]
        s = (depth - c.profile_depth[i]) / length
        change = c.profile_velocity[i + 1] - c.profile_velocity[i]
        f.velocity = f.velocity + c.profile_velocity[i] + wp.clamp(s, real(0.0), real(1.0)) * change
        if s > real(0.0) and s < real(1.0):
            f.gradient = f.gradient + wp.outer(change / length, down)
        for j in range(c.harmonic_omega.shape[0]):
            omega = c.harmonic_omega[j]
            angle = omega * t + c.harmonic_phase[j]
            f.velocity = f.velocity + wp.cos(angle) * c.harmonic_amplitude[j]
            f.rate = f.rate - (omega * wp.sin(angle)) * c.harmonic_amplitude[j]
        for j in range(c.wave_number.shape[0]):
            k = c.wave_number[j]
            omega = c.wave_omega[j]
            along = c.wave_direction[j]
            theta = k * wp.dot(along, b) - omega * t + c.wave_phase[j]
            size = c.wave_speed[j] * wp.exp(-k * wp.max(depth, real(0.0)))
            cosine = size * wp.cos(theta)
            sine = size * wp.sin(theta)
            u = cosine * along - sine * down
            slope = sine * along + cosine * down
            f.velocity = f.velocity + u
            f.rate = f.rate + omega * slope
            f.gradient = f.gradient - wp.outer(slope, k * along)
            if depth > real(0.0):
                f.gradient = f.gradient - wp.outer(k * u, down)
        return f

    @wp.func
    def forces(A: mat33, b: vec3, t: real, n: thrusts, flow: Flow, c: Parameters):
        """All forces and torques from position, attitude and time."""
        w = Wrench()
        to_body = wp.transpose(A)
        z = to_body * vec3(real(0.0), real(0.0), real(1.0))
        f = c.net * z + c.force + at_time(t, c.schedule_time, c.schedule_force)
        m = c.torque + at_time(t, c.schedule_time, c.schedule_torque) - wp.cross(c.moment, z)
        # tether
        d = c.anchor - b - A * c.attachment
        length = wp.length(d)
        if length > c.rest_length:
            pull = to_body * ((c.stiffness * (real(1.0) - c.rest_length / length)) * d)
            f = f + pull
            m = m + wp.cross(c.attachment, pull)
        # stratification
        excess_depth = b[2] + wp.dot(z, c.strata_center) - c.strata_depth
        lift = -(c.strata_stiffness * excess_depth) * z
        f = f + lift
        m = m + wp.cross(c.strata_center, lift)
        # thrusters
        for j in range(wp.static(THRUSTERS)):
            ahead = wp.max(n[j] - c.thruster_band[j], real(0.0))
            astern = wp.max(-n[j] - c.thruster_band[j], real(0.0))
            thrust = c.thruster_ahead[j] * ahead * ahead - c.thruster_astern[j] * astern * astern
            f = f + thrust * c.thruster_direction[j]
            m = m + thrust * c.thruster_arm[j]
        # water that accelerates
        a = to_body * (flow.rate + flow.gradient * flow.velocity)
        w.force = f + c.excess * a
        w.torque = m + wp.cross(c.excess_lever, a)
        return w

    @wp.func
    def add_fin(D: Damping, v: vec3, w: vec3, angle: real, j: int, c: Parameters):
        """One fin turned by an angle."""
        e = c.fin_chord[j]
        e_arm = c.fin_chord_arm[j]
        n = c.fin_normal[j]
        n_arm = c.fin_normal_arm[j]
        if j >= c.fixed_fins:
            cosine = wp.cos(angle)
            sine = wp.sin(angle)
            e = cosine * c.fin_chord[j] + sine * c.fin_normal[j]
            e_arm = cosine * c.fin_chord_arm[j] + sine * c.fin_normal_arm[j]
            n = cosine * c.fin_normal[j] - sine * c.fin_chord[j]
            n_arm = cosine * c.fin_normal_arm[j] - sine * c.fin_chord_arm[j]
        along = wp.dot(e, v) + wp.dot(e_arm, w)
        across = wp.dot(n, v) + wp.dot(n_arm, w)
        speed = wp.sqrt(along * along + across * across)
        if speed > real(0.0):
            lift = c.fin_lift[j] * along * across / speed
            drag = c.fin_drag[j] * speed + c.fin_drag_normal[j] * across * across / speed
            e_row = drag * e - lift * n
            e_row_arm = drag * e_arm - lift * n_arm
            n_row = drag * n + lift * e
            n_row_arm = drag * n_arm + lift * e_arm
            D.D11 = D.D11 + wp.outer(e, e_row) + wp.outer(n, n_row)
            D.D12 = D.D12 + wp.outer(e, e_row_arm) + wp.outer(n, n_row_arm)
            D.D21 = D.D21 + wp.outer(e_arm, e_row) + wp.outer(n_arm, n_row)
            D.D22 = D.D22 + wp.outer(e_arm, e_row_arm) + wp.outer(n_arm, n_row_arm)
        return D

    @wp.func
    def damping(v: vec3, w: vec3, shear: mat33, angle: angles, c: Parameters):
        """(force; torque) = -D (v; w): all laws that see velocities; shear: m X + X^T A, X = R^T G R."""
        D = Damping()
        by_v = wp.diag(vec3(wp.abs(v[0]), wp.abs(v[1]), wp.abs(v[2])))
        by_w = wp.diag(vec3(wp.abs(w[0]), wp.abs(w[1]), wp.abs(w[2])))
        D.D11 = c.linear_11 + c.quadratic_11 * by_v + v[0] * c.lift_11 + shear
        D.D12 = c.linear_12 + c.quadratic_12 * by_w + v[0] * c.lift_12
        D.D21 = c.linear_21 + c.quadratic_21 * by_v + v[0] * c.lift_21
        D.D22 = c.linear_22 + c.quadratic_22 * by_w + v[0] * c.lift_22
        for j in range(c.fixed_fins):
            D = add_fin(D, v, w, real(0.0), j, c)
        for j in range(wp.static(CONTROL_FINS)):
            D = add_fin(D, v, w, angle[j], c.fixed_fins + j, c)
        # cross-flow: sums of s, s x and s x^2 over the strips
        S0 = real(0.0)
        S1 = real(0.0)
        S2 = real(0.0)
        for j in range(c.strip_station.shape[0]):
            x = c.strip_station[j]
            sway = v[1] + x * w[2]
            heave = v[2] - x * w[1]
            s = c.strip_strength[j] * wp.sqrt(sway * sway + heave * heave)
            S0 += s
            S1 += s * x
            S2 += s * x * x
        D.D11[1, 1] = D.D11[1, 1] + S0
        D.D11[2, 2] = D.D11[2, 2] + S0
        D.D12[1, 2] = D.D12[1, 2] + S1
        D.D12[2, 1] = D.D12[2, 1] - S1
        D.D21[1, 2] = D.D21[1, 2] - S1
        D.D21[2, 1] = D.D21[2, 1] + S1
        D.D22[1, 1] = D.D22[1, 1] + S2
        D.D22[2, 2] = D.D22[2, 2] + S2
        return D

    @wp.func
    def factorise(D: Damping, h: real, c: Parameters):
        """The blocks of I6 + h D, eliminated."""
        f = Factor()
        f.inverse = wp.inverse(c.M + h * D.D11)
        f.upper = f.inverse * (h * D.D12)
        f.lower = h * D.D21
        f.schur = wp.inverse(c.J + h * D.D22 - f.lower * f.upper)
        return f

    @wp.func
    def solve6(f: Factor, p: vec3, q: vec3):
        x = f.inverse * p
        y = f.schur * (q - f.lower * x)
        return x - f.upper * y, y

    @wp.func
    def randn3(rng: wp.uint32):
        """Three normal numbers and the generator after them."""
        x = real(wp.randn(rng))
        y = real(wp.randn(rng))
        z = real(wp.randn(rng))
        return vec3(x, y, z), rng

    @wp.kernel(module="unique")
    def psi_s(
        b: wp.array(dtype=vec3),
        R: wp.array(dtype=mat33),
        nu: wp.array(dtype=vec3),
        Om: wp.array(dtype=vec3),
        c: Parameters,
        h: real,
        steps: int,
        seed: int,
    ):
        i = wp.tid()
        # A product makes a copy; b[i] alone would be a reference into the array.
        one = real(1.0)
        x, A = one * b[i], one * R[i]
        zero = vec3(real(0.0), real(0.0), real(0.0))
        wander, wander_rate = one * zero, one * zero
        start = water(x, real(0.0), wander, wander_rate, c)
        p = c.M * (nu[i] - wp.transpose(A) * start.velocity)
        q = c.J * Om[i]
        n = thruster_commands(real(0.0), c)
        angle = rudder_commands(real(0.0), c)
        half = real(0.5) * h
        gamma = real(wp.static(GAMMA)) * h
        rest = h - gamma
        over_root_h = one / wp.sqrt(h)
        rng = wp.rand_init(seed, i)
        for k in range(steps):
            t = (real(k) + real(0.5)) * h
            # T, D
            v = c.M_inverse * p
            x = x + half * (A * v)
            q = q + half * wp.cross(p, v)
            F = equation_24(half * q, c.J, c.J_inverse)
            A = A * F
            p = wp.transpose(F) * p
            q = wp.transpose(F) * q
            # K: what laws remember, half of the water's drift, half the kick
            n = lagged(n, t, half, c)
            angle = steered(angle, t, half, c)
            xi, rng = randn3(rng)
            new = c.markov_decay * wander + wp.cw_mul(c.markov_spread, xi)
            wander_rate = (new - wander) / h
            mean = real(0.5) * (wander + new)
            wander = new
            before = x
            flow = water(x, t, mean, wander_rate, c)
            x = before + half * flow.velocity
            flow = water(x, t, mean, wander_rate, c)
            w = forces(A, x, t, n, flow, c)
            xi, rng = randn3(rng)
            f = w.force + over_root_h * wp.cw_mul(c.noise_force, xi)
            xi, rng = randn3(rng)
            m = w.torque + over_root_h * wp.cw_mul(c.noise_torque, xi)
            p = p + half * f
            q = q + half * m
            # damping, linearly implicit
            X = wp.transpose(A) * flow.gradient * A
            shear = c.mass * X + wp.transpose(X) * c.added
            D = damping(c.M_inverse * p, c.J_inverse * q, shear, angle, c)
            v, u = solve6(factorise(D, half, c), p, q)
            D = damping(v, u, shear, angle, c)
            factor = factorise(D, gamma, c)
            v, u = solve6(factor, p, q)
            p = p - rest * (D.D11 * v + D.D12 * u)
            q = q - rest * (D.D21 * v + D.D22 * u)
            v, u = solve6(factor, p, q)
            p = p - gamma * (D.D11 * v + D.D12 * u)
            q = q - gamma * (D.D21 * v + D.D22 * u)
            # the other halves
            p = p + half * f
            q = q + half * m
            x = before + h * flow.velocity
            n = lagged(n, t + half, half, c)
            angle = steered(angle, t + half, half, c)
            # D, T
            F = equation_24(half * q, c.J, c.J_inverse)
            A = A * F
            p = wp.transpose(F) * p
            q = wp.transpose(F) * q
            v = c.M_inverse * p
            x = x + half * (A * v)
            q = q + half * wp.cross(p, v)
        end = water(x, real(steps) * h, wander, wander_rate, c)
        b[i] = x
        R[i] = A
        nu[i] = c.M_inverse * p + wp.transpose(A) * end.velocity
        Om[i] = c.J_inverse * q

    return psi_s, Parameters


def parameters(scene, h):
    """Name -> numbers of the scene, whose terms are those of scenes.all_terms(), with or without noise."""
    vehicle, g, density = scene.vehicle, scene.environment.gravity, scene.environment.water_density
    laws = {term.type: term for term in scene.terms}
    M, J = vehicle.mass_matrix, vehicle.inertia
    displaced = vehicle.buoyancy / g
    found = {"M": M, "M_inverse": np.linalg.inv(M), "J": J, "J_inverse": np.linalg.inv(J),
             "net": vehicle.mass * g - vehicle.buoyancy, "moment": vehicle.buoyancy * vehicle.center_of_buoyancy,
             "excess": displaced - vehicle.mass, "excess_lever": displaced * vehicle.center_of_buoyancy,
             "mass": vehicle.mass, "added": vehicle.added_mass}  # fmt: skip
    drag = laws["drag_matrix"]
    for name, matrix in (("linear", drag.linear), ("quadratic", drag.quadratic), ("lift", laws["body_lift"].matrix)):
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            found[f"{name}_{i + 1}{j + 1}"] = matrix[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
    return (
        found
        | _water(laws, g, h)
        | _wrenches(laws, vehicle)
        | _thrusters(laws["thrusters"], h)
        | _fins(laws["fins"], laws["control_fins"], density)
        | _strips(laws["cross_flow"], density)
    )


def _water(laws, g, h):
    profile, harmonics, waves = laws["current_profile"], laws["current_harmonics"], laws["waves"]
    omega, heading = 2.0 * np.pi / waves.periods, np.radians(waves.headings_deg)
    found = {
        "current": laws["current"].velocity,
        "profile_depth": profile.depths,
        "profile_velocity": profile.velocities,
        "harmonic_amplitude": harmonics.amplitudes,
        "harmonic_omega": 2.0 * np.pi / harmonics.periods,
        "harmonic_phase": harmonics.phases,
        "wave_direction": np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1),
        "wave_number": omega**2 / g,
        "wave_omega": omega,
        "wave_speed": waves.amplitudes * omega,
        "wave_phase": waves.phases,
        "markov_decay": 1.0,
        "markov_spread": np.zeros(3),
    }
    if wandering := laws.get("gauss_markov_current"):
        decay = math.exp(-h / wandering.time_constant)
        found |= {"markov_decay": decay, "markov_spread": wandering.standard_deviation * math.sqrt(1.0 - decay**2)}
    return found


def _wrenches(laws, vehicle):
    tether, held, schedule, strata = (laws[name] for name in ("tether", "wrench", "wrench_schedule", "stratification"))
    noise = laws.get("wrench_noise")
    return {
        "anchor": tether.anchor,
        "attachment": tether.attachment,
        "stiffness": tether.stiffness,
        "rest_length": tether.rest_length,
        "force": held.force,
        "torque": held.torque,
        "schedule_time": schedule.times,
        "schedule_force": schedule.force,
        "schedule_torque": schedule.torque,
        "noise_force": noise.force if noise else np.zeros(3),
        "noise_torque": noise.torque if noise else np.zeros(3),
        "strata_stiffness": vehicle.buoyancy * strata.gradient,
        "strata_center": vehicle.center_of_buoyancy,
        "strata_depth": strata.reference_depth,
    }


def _thrusters(law, h):
    direction = law.direction / np.linalg.norm(law.direction, axis=1, keepdims=True)
    assert len(direction) == THRUSTERS
    assert np.all(law.time_constant > 0.0)
    return {
        "thruster_direction": direction,
        "thruster_arm": np.cross(law.position, direction),
        "thruster_ahead": law.coefficient,
        "thruster_astern": law.coefficient_astern,
        "thruster_band": law.dead_band,
        "thruster_limit": law.limit,
        "thruster_lag": np.exp(-0.5 * h / law.time_constant),
        "thruster_delay": law.time_constant / (0.5 * h),
        "thruster_time": law.times,
        "thruster_command": law.command_schedule,
    }


def _fins(fixed, turning, density):
    assert len(turning.area) == CONTROL_FINS
    position, chord, normal, area, lift, drag, drag_normal = (
        np.concatenate([getattr(fixed, name), getattr(turning, name)])
        for name in ("position", "chord", "normal", "area", "lift_slope", "drag", "drag_normal")
    )
    chord = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    normal = normal - np.sum(normal * chord, axis=1, keepdims=True) * chord
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    half = 0.5 * density * area
    return {
        "fin_chord": chord,
        "fin_chord_arm": np.cross(position, chord),
        "fin_normal": normal,
        "fin_normal_arm": np.cross(position, normal),
        "fin_lift": half * lift,
        "fin_drag": half * drag,
        "fin_drag_normal": half * drag_normal,
        "fixed_fins": len(fixed.area),
        "rudder_limit": turning.limit,
        "rudder_rate": turning.rate_limit,
        "rudder_time": turning.times,
        "rudder_command": turning.command_schedule,
    }


def _strips(hull, density):
    """Two Gauss points a segment, the strength linear there."""
    half = 0.5 * np.diff(hull.stations)
    middle = hull.stations[:-1] + half
    stations = np.concatenate([middle - half / math.sqrt(3.0), middle + half / math.sqrt(3.0)])
    strength = np.interp(stations, hull.stations, hull.drag_coefficient * hull.diameters)
    return {"strip_station": stations, "strip_strength": 0.5 * density * strength * np.concatenate([half, half])}


def command(scene, states, h, steps, dtype="float64", seed=1):
    """(arrays, call): the fleet's b, R, nu, Om, shapes (n, 3), (n, 3, 3), (n, 3), (n, 3), and a call that advances them.

    scene: one of scenes.all_terms(). A call makes the steps from t = 0 from where the arrays are.
    """
    real = wp.float64 if dtype == "float64" else wp.float32
    mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)
    arrays = [
        wp.array(np.ascontiguousarray(x, dtype), dtype=t, device="cpu")
        for x, t in zip(states, (vec3, mat33, vec3, vec3), strict=True)
    ]
    kernel, Parameters = make_ordinary(real)
    values = Parameters()
    kinds = Parameters.vars
    for name, value in parameters(scene, h).items():
        kind = kinds[name].type
        if isinstance(kind, wp.array):
            setattr(values, name, wp.array(np.ascontiguousarray(value, dtype), dtype=kind.dtype, device="cpu"))
        elif np.ndim(value):
            setattr(values, name, kind(*np.asarray(value, dtype).ravel()))
        else:
            setattr(values, name, kind(value))
    inputs = [*arrays, values, real(h), steps, seed]
    return arrays, wp.launch(kernel, len(states[0]), inputs=inputs, device="cpu", record_cmd=True).launch
