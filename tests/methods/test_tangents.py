# SPDX-License-Identifier: Apache-2.0
"""Derivatives of whole runs by dual lanes: closed forms, what a symplectic map keeps, differences, and what is refused.

A closed form is differentiated by a complex step, f'(x) = Im f(x + i e) / e, exact to round-off: it shares nothing with the
rules of the kernel nor with the differences of what is packed.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from benchmarks import problems
from lgvi_kernels.lanes import arithmetic, functions, noise, sums
from lgvi_kernels.lanes.arithmetic import lane, mul  # noqa: F401
from lgvi_kernels.tangents.lanes import declare
from lgvi_kernels.tangents.native import DualShape, snippets
from lgvi_warp.engine.tangents import Slopes
from lgvi_warp.scene.variations import Target
from tests.control.test_analytic import FAR, INERTIA, MASS, NONE, PERIOD
from tests.support.tools import slope

pytestmark = pytest.mark.kernel

TINY = 1e-30
GRAVITY, ADDED = 10.0, 10.0
FALL = {"vehicle.mass": 20.0, "vehicle.buoyancy": 170.0, "drag.quadratic[2]": 40.0, "drag.linear[0]": 12.0,
        "start.velocity[0]": 0.7, "start.velocity[2]": 0.2}  # fmt: skip
TIME = 2.0


def falling(numbers=FALL):
    """A sphere that falls against quadratic drag, and goes ahead against linear drag; nothing turns it."""
    m, B, q, k, u, w = numbers.values()
    vehicle = lw.Vehicle(m, inertia=(0.4, 0.4, 0.4), added_mass=(ADDED,) * 3, buoyancy=B, center_of_buoyancy=NONE)
    drag = lw.terms.Drag(linear=(k, 0, 0, 0, 0, 0), quadratic=(0, 0, q, 0, 0, 0))
    start = lw.Start([0.0, 0.0, 0.0], euler_deg=NONE, velocity=(u, 0.0, w), angular_velocity=NONE)
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), [drag], start)


def fallen(m, B, q, k, u, w):
    """(x, z, velocity along x, along z) at TIME: M w' = F - q w^2 and M u' = -k u with M = m + ADDED, F = m g - B."""
    M, F = m + ADDED, m * GRAVITY - B
    limit, tau = np.sqrt(F / q), M / np.sqrt(F * q)
    phase = np.arctanh(w / limit)
    z = limit * tau * (np.log(np.cosh(TIME / tau + phase)) - np.log(np.cosh(phase)))
    left = np.exp(-k * TIME / M)
    return np.array([u * M / k * (1.0 - left), z, u * left, limit * np.tanh(TIME / tau + phase)])


def by_complex_step(function, numbers):
    """The derivatives (values, numbers) of a function."""
    columns = []
    for i in range(len(numbers)):
        shifted = np.array(numbers, complex)
        shifted[i] += 1j * TINY
        columns.append(function(*shifted).imag / TINY)
    return np.stack(columns, axis=-1)


def slopes_of_fall(method, h):
    """The same by a run."""
    result = lw.solve(falling(), method, h=h, t1=TIME, tangents=list(FALL), threads=1)
    assert result.tangents == tuple(FALL)
    assert not result.messages
    position, velocity = (result.jacobian[name][-1, 0] for name in ("position", "velocity"))
    return np.concatenate([position[[0, 2]], velocity[[0, 2]]])


@pytest.mark.slow
def test_a_fall_against_drag():
    expected = by_complex_step(fallen, list(FALL.values()))
    # 8th order: at this step its error is below that of the differences of what is packed, 1e-12 of each number.
    np.testing.assert_allclose(slopes_of_fall("rk8", 0.02), expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())


@pytest.mark.ci
@pytest.mark.slow_for("psi_x")
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_derivatives_have_the_order_of_the_method(method):
    expected = by_complex_step(fallen, list(FALL.values()))
    steps = np.array([0.08, 0.04, 0.02])
    errors = [np.abs(slopes_of_fall(method, h) - expected).max() for h in steps]
    # Second order; the next term of the error moves a slope between such steps by a few hundredths.
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-3


def free():
    """A body that nothing acts on, which turns about a principal axis."""
    vehicle = lw.Vehicle(20.0, inertia=(3.0, 2.5, 2.0), added_mass=(10.0,) * 3, buoyancy=200.0, center_of_buoyancy=NONE)
    start = lw.Start(NONE, euler_deg=NONE, velocity_inertial=(0.5, -0.2, 0.1), angular_velocity=(0.0, 0.0, 0.8))
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), start=start)


@pytest.mark.slow
def test_a_steady_spin_and_a_free_motion():
    names, t = ["start.angular_velocity[2]", "start.velocity_inertial[0]"], 3.0
    result = lw.solve(free(), "rk8", h=0.05, t1=t, save=lw.SaveAt(every=1.0), tangents=names, threads=1)
    for k, at in enumerate(result.time):
        angle = 0.8 * at
        turn = np.array([[-np.sin(angle), -np.cos(angle), 0.0], [np.cos(angle), -np.sin(angle), 0.0], [0.0, 0.0, 0.0]])
        np.testing.assert_allclose(result.jacobian["attitude"][k, 0, ..., 0], at * turn, atol=1e-10)
        np.testing.assert_allclose(result.jacobian["position"][k, 0], [[0.0, at], [0.0, 0.0], [0.0, 0.0]], atol=1e-10)


GAINS = {"pose_pid.kp[0]": 30.0, "pose_pid.kd[0]": 40.0, "wrench.force[0]": 3.0, "vehicle.mass": MASS,
         "start.position[0]": 1.0, "start.velocity[0]": 0.5}  # fmt: skip


def held_loop(kp, kd, F, mass, x, v, ticks=50):
    """(x, v) at the last tick of a double integrator with the held force F - kp x - kd v."""
    for _ in range(ticks):
        a = (F - kp * x - kd * v) / mass
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * a, v + PERIOD * a
    return np.array([x, v])


def looped(**sensor):
    """A body whose position along x is held by a sampled law; sensor: numbers of a sensor of the position."""
    kp, kd, F, mass, x, v = GAINS.values()
    law = lw.control.PosePID(**dict.fromkeys(("kr", "kw"), NONE), kp=(kp, 0.0, 0.0), kd=(kd, 0.0, 0.0))
    sensors = [lw.control.Sensor(of="position", name="fix", **sensor)] if sensor else []
    stuck = lw.control.Fault(of="control_wrench", channel=0, name="stuck", time=np.inf, gain=0.5)
    controller = lw.Controller(
        faults=[stuck] if sensor else [],
        period=PERIOD,
        sensors=sensors,
        guidance=[lw.control.SetPoint(position=NONE, heading=0.0)],
        laws=[law],
    )
    vehicle = lw.Vehicle(mass, inertia=INERTIA, added_mass=NONE, buoyancy=mass * GRAVITY, center_of_buoyancy=NONE)
    terms = [lw.terms.ControlWrench(limit=FAR), lw.terms.Wrench(force=(F, 0.0, 0.0))]
    start = lw.Start((x, 0.0, 0.0), euler_deg=NONE, velocity=(v, 0.0, 0.0), angular_velocity=NONE)
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms, start, controller=controller)


@pytest.mark.slow
def test_a_sampled_loop():
    t1 = 50 * PERIOD
    save = lw.SaveAt(at=[t1], fields=("position", "velocity", "command"))
    result = lw.solve(looped(), "rk8", h=PERIOD / 2, t1=t1, save=save, tangents=list(GAINS), threads=1)
    expected = by_complex_step(held_loop, list(GAINS.values()))
    got = np.stack([result.jacobian[name][-1, 0, 0] for name in ("position", "velocity")])
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())
    # The last tick's command is -kp x - kd v there.
    x, v = result.position[-1, 0, 0], result.velocity[-1, 0, 0]
    kp, kd = GAINS["pose_pid.kp[0]"], GAINS["pose_pid.kd[0]"]
    command = -kp * expected[0] - kd * expected[1] - np.array([x, v, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(result.jacobian["command"][-1, 0, 0], command, rtol=1e-10, atol=1e-9)


def vee(A):
    return 0.5 * np.stack([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])


@pytest.mark.ci
def test_psi_s_is_symplectic():
    # Perturbations (xi, eta) = (R^T db, vee(R^T dR)) of the pose and dmu of the momenta mu = (p, pi) in body axes. The form is
    # dmu1.zeta2 - dmu2.zeta1 - mu.[zeta1, zeta2], with the bracket of se(3).
    paper = lw.Scene.load("examples/paper.toml")
    start = lw.Start(
        (0.0, 0.0, 400.0), euler_deg=(40.0, -30.0, 70.0), velocity=(0.3, -0.4, 0.8), angular_velocity=(0.3, 0.2, 0.1)
    )
    scene = lw.Scene(paper.vehicle, paper.environment, paper.terms, start)
    kinds = ("position", "euler_deg", "velocity", "angular_velocity")
    names = [f"start.{kind}[{i}]" for kind in kinds for i in range(3)]
    result = lw.solve(scene, "psi_s", h=0.02, t1=4.0, tangents=names, threads=1)
    numbers = scene.parameters()
    M = numbers["vehicle.mass"] * np.eye(3) + numbers["vehicle.added_mass"]
    J = numbers["vehicle.inertia"]

    def form(k):
        R, nu, Om = (result.samples[name][k, 0] for name in ("attitude", "velocity", "angular_velocity"))
        by = {name: slopes[k, 0] for name, slopes in result.jacobian.items()}
        xi = R.T @ by["position"]
        eta = vee(np.einsum("ji,jkn->ikn", R, by["attitude"]))
        zeta, dmu = np.concatenate([xi, eta]), np.concatenate([M @ by["velocity"], J @ by["angular_velocity"]])
        p, pi = M @ nu, J @ Om
        cross = np.cross
        turned = np.einsum("i,abi->ab", pi, cross(eta.T[:, None], eta.T[None]))
        moved = np.einsum("i,abi->ab", p, cross(eta.T[:, None], xi.T[None]) - cross(eta.T[None], xi.T[:, None]))
        return dmu.T @ zeta - zeta.T @ dmu - turned - moved

    before, after = form(0), form(-1)
    assert np.abs(np.linalg.inv(before)).max() < 1e4  # the twelve directions are independent
    np.testing.assert_allclose(after, before, atol=1e-10 * np.abs(before).max())
    assert np.abs(result.jacobian["position"][-1]).max() > 1.0


def differences(scene, name, size, method, **settings):
    """Derivatives of the last samples by central differences of four points, 1e-4 of `size` apart, with the same noise."""
    whole, _, place = name.partition("[")
    index = tuple(int(k) for k in place[:-1].split(",")) if place else ()
    value = lw.Ensemble(scene).numbers(0, 1)[whole][0][index]
    e = 1e-4 * size
    around = lw.Ensemble(scene, sampling=lw.designs.Table({name: value + e * np.array([-2.0, -1.0, 1.0, 2.0])}))
    around.indices = np.zeros(4, np.int64)
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * e)
    samples = lw.solve(around, method, **settings).samples
    return {field: np.einsum("j,j...->...", weights, values[-1]) for field, values in samples.items()}


def assert_agree(scene, sizes, method, part, **settings):
    """part: how far differences may be off, of the largest."""
    result = lw.solve(scene, method, tangents=list(sizes), **settings)
    for i, (name, size) in enumerate(sizes.items()):
        for field, expected in differences(scene, name, size, method, **settings).items():
            got = result.jacobian[field][-1, 0, ..., i]
            np.testing.assert_allclose(got, expected, rtol=0.0, atol=part * np.abs(expected).max() + 1e-9)


@pytest.mark.ci
def test_remus_against_differences():
    # Steps of 1e-4: an error of 1e-16 / 1e-4 in sizes of 10, and of the 4th power of the step, but where drag has a kink.
    start = {"velocity": [1.5, 0.05, 0.1], "euler_deg": [2.0, 3.0, 4.0], "angular_velocity": [0.01, 0.02, 0.03]}
    scene = lw.Scene.named("remus_100", start=start)
    sizes = {"start.euler_deg[1]": 3.0, "control_fins.lift_slope[0]": 3.0, "start.velocity[0]": 1.5,
             "drag_matrix.quadratic[0,0]": 1.0}  # fmt: skip
    assert_agree(scene, sizes, "rk4", 1e-7, h=0.05, t1=3.0, threads=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["psi", "psi_1", "psi_x8", "phi", "phi_adjoint", "cg3", "rkmk4", "rk5", "rkn4_6", "rkn6_14", "kl8(psi_s)"]
)
def test_each_method_against_differences(method):
    paper = lw.Scene.load("examples/paper.toml")
    start = lw.Start(NONE, euler_deg=(40.0, -30.0, 70.0), velocity=(0.1, 0.2, 1.0), angular_velocity=(0.3, 0.2, 0.1))
    scene = lw.Scene(paper.vehicle, paper.environment, paper.terms, start)
    sizes = {"start.velocity[0]": 1.0, "vehicle.inertia[1,1]": 5.0}
    assert_agree(scene, sizes, method, 1e-7, h=0.05, t1=2.0, threads=1)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "noise"), [("psi_x", True), ("rk4", False)])
def test_all_terms_against_differences(method, noise):
    sizes = {"vehicle.mass": 20.0, "current_profile.velocities[2,2]": 0.1, "waves.amplitudes[6]": 0.1, "waves.periods[3]": 5.0,
             "tether.attachment[0]": 0.3, "thrusters.dead_band[1]": 1.0, "fins.area[1]": 0.01, "control_fins.drag[0]": 0.1,
             "cross_flow.diameters[0]": 0.1, "stratification.gradient": 1e-3, "start.rotation_vector[0]": 1.0}  # fmt: skip
    if noise:
        sizes |= {"gauss_markov_current.time_constant": 10.0, "wrench_noise.torque[2]": 0.1}
    # Kinks of |v| v and of dead bands are passed at slightly other times.
    assert_agree(problems.all_terms(noise), sizes, method, 1e-4, h=0.02, t1=2.0, threads=1)


@pytest.mark.slow
@pytest.mark.parametrize("tangents", [1, 3])
def test_a_current_on_a_grid_against_differences(tangents):
    # Within one cell: slopes of the water jump from cell to cell. Lanes with one slope, and of an odd length.
    rng = np.random.default_rng(2)
    field = lw.terms.CurrentField(velocities=0.3 * rng.normal(size=(2, 3, 4, 4, 2, 3)), origin=[-40.0, -40.0, 0.0],
                                  spacing=[20.0, 30.0, 50.0], times=[-1.0, 10.0], scenario=1.0)  # fmt: skip
    start = {"position": [3.0, 4.0, 11.0], "velocity": [0.5, 0.1, 0.0], "euler_deg": [2.0, 3.0, 4.0]}
    scene = lw.Scene.named("remus_100", terms=[field], start=start)
    sizes = {"start.position[0]": 10.0, "start.position[2]": 10.0, "current_field.velocities[1,0,2,1,0,1]": 1.0}
    assert_agree(scene, dict(list(sizes.items())[-tangents:]), "rk4", 1e-7, h=0.05, t1=2.0, threads=1)


@pytest.mark.slow
def test_float32_has_its_own_digits():
    settings = {"h": 0.02, "t1": TIME, "tangents": list(FALL), "threads": 1}
    single, double = (lw.solve(falling(), "rk4", dtype=dtype, **settings) for dtype in ("float32", "float64"))
    for name, slopes in double.jacobian.items():
        # A hundred steps, each rounded to 1e-7 of the largest number in it.
        np.testing.assert_allclose(single.jacobian[name], slopes, rtol=0.0, atol=1e-5 * max(1.0, np.abs(slopes).max()))


@pytest.mark.slow
def test_threads_and_blocks_change_no_bit():
    vary = {"start.velocity": lw.distributions.Normal(std=0.1)}
    fleet = lw.Ensemble(falling(), 700, 1, vary)
    settings = {"h": 0.02, "t1": 0.2, "tangents": ["vehicle.mass", "start.velocity[2]"]}
    several, single = (lw.solve(fleet, "rk8", threads=threads, **settings) for threads in (3, 1))
    alone = lw.solve(fleet.subset([5, 699]), "rk8", threads=1, **settings)
    for name, slopes in single.jacobian.items():
        np.testing.assert_array_equal(several.jacobian[name], slopes)
        np.testing.assert_array_equal(alone.jacobian[name], slopes[:, [5, 699]])


@pytest.mark.slow
def test_values_are_those_of_the_run_without_tangents():
    plain = lw.solve(falling(), "rk8", h=0.02, t1=TIME, threads=1)
    result = lw.solve(falling(), "rk8", h=0.02, t1=TIME, tangents=list(FALL), threads=1)
    for name, values in plain.samples.items():
        # Products and sums are joined elsewhere: the round-off of a hundred steps.
        np.testing.assert_allclose(result.samples[name], values, rtol=1e-13, atol=1e-13)
    assert not plain.jacobian
    assert not plain.tangents


@pytest.mark.ci
def test_a_file_holds_them(tmp_path):
    masses = lw.designs.Table({"vehicle.mass": [20.0, 21.0, 22.0]})
    fleet = lw.Ensemble(falling(), sampling=masses)
    result = lw.solve(fleet, "rk8", h=0.02, t1=TIME, tangents=list(FALL), threads=1)
    again = lw.Result.load(result.save(tmp_path / "run.npz"))
    assert again.tangents == result.tangents
    for name, slopes in result.jacobian.items():
        np.testing.assert_array_equal(again.jacobian[name], slopes)
        np.testing.assert_array_equal(again.part(np.array([2, 0])).jacobian[name], slopes[:, [2, 0]])


@pytest.mark.ci
def test_members_have_slopes_of_their_own():
    masses = np.array([18.0, 20.0, 25.0, 31.0, 20.0, 22.0, 23.0, 24.0, 26.0, 20.0])
    fleet = lw.Ensemble(falling(), sampling=lw.designs.Table({"vehicle.mass": masses}))
    result = lw.solve(fleet, "rk8", h=0.02, t1=TIME, tangents=list(FALL), threads=1)
    for i, mass in enumerate(masses):
        expected = by_complex_step(fallen, [mass, *list(FALL.values())[1:]])
        got = np.concatenate([result.jacobian[name][-1, i][[0, 2]] for name in ("position", "velocity")])
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())


@pytest.mark.slow
def test_a_member_that_ended_has_no_derivatives_from_there_on():
    base = falling()
    scene = lw.Scene(base.vehicle, base.environment, base.terms, base.start, events=[lw.events.Floor(depth=0.8)])
    result = lw.solve(scene, "rk8", h=0.02, t1=TIME, save=lw.SaveAt(every=0.5), tangents=["vehicle.mass"], threads=1)
    slopes = result.jacobian["position"][:, 0, 2, 0]
    ended = result.time >= result.failure_time[0]
    assert ended.any()
    assert not ended.all()
    assert np.isnan(slopes[ended]).all()
    assert np.isfinite(slopes[~ended]).all()
    assert "1 of 1 members ended on the way" in result.messages[-1]


@pytest.mark.parametrize(
    ("tangents", "settings", "message"),
    [
        *((listed, {}, "is not a list of names") for listed in ([], 5, True, {"vehicle.mass"}, {"vehicle.mass": 1})),
        (iter(["a"]), {}, "does not name what the scene has"),
        ([["vehicle.mass"]], {}, "is not a list of names"),
        ([["vehicle.mass"], "vehicle.mass"], {}, "is not a list of names"),
        (["vehicle.mas"], {}, "does not name what the scene has"),
        (["drag.quadratic"], {}, "names 6 numbers"),
        (["vehicle.mass", "vehicle.mass"], {}, "is named twice"),
        (["vehicle.mass"], {"dtype": "float32_compensated", "method": "psi_s"}, "whose rest has no slope"),
        (["vehicle.mass"], {"method": "psi_w"}, "iterates until its values have converged"),
        (["vehicle.mass"], {"width": 1}, "too narrow for tangents"),
        (["vehicle.mass"], {"store": "run.zarr"}, "not in a store"),
        (["vehicle.mass"], {"keep": "none"}, "none are kept"),
        (["start.attitude[0,0]"], {}, "does not name"),
    ],
)
def test_refused(tangents, settings, message):
    words = {"method": "rk8", "h": 0.02, "t1": TIME} | settings
    with pytest.raises(lw.SceneError, match=message):
        lw.solve(falling(), words.pop("method"), tangents=tangents, **words)


@pytest.mark.parametrize(
    "name", ["controller.delay", "fix.every", "fix.latency", " fix.dropout ", "fix.quantum", "stuck.time"]
)
def test_what_acts_by_whole_steps_has_no_derivative(name):
    with pytest.raises(lw.SceneError, match=f"{name.strip()}.*no derivative"):
        lw.solve(looped(noise=0.1), "rk8", h=PERIOD / 2, t1=1.0, tangents=[name])


def test_the_radius_of_waypoints_has_no_derivative():
    points = lw.control.Waypoints(points=[[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]], speed=1.5, look_ahead=10.0, radius=2.0)
    controller = lw.Controller(period=PERIOD, guidance=[points], laws=looped().controller.laws)
    scene = dataclasses.replace(looped(), controller=controller)
    with pytest.raises(lw.SceneError, match=r"radius.*sets the tick at which a leg is done"):
        lw.solve(scene, "rk8", h=PERIOD / 2, t1=1.0, tangents=["waypoints.radius"])


def test_the_times_of_a_schedule_in_steps_have_no_derivative():
    push = lw.terms.WrenchSchedule(times=[0.0, 1.0], force=[[0.0] * 3, [9.0, 0.0, 0.0]], interpolation="steps")
    scene = dataclasses.replace(free(), terms=[push])
    with pytest.raises(lw.SceneError, match=r"wrench_schedule.times\[1\].*no derivative"):
        lw.solve(scene, "psi_x", h=0.1, t1=0.3, tangents=["wrench_schedule.times[1]"])


@pytest.mark.ci
def test_thrusters_at_their_limits_against_differences():
    """Bounded least squares sums products over rows of the memory, which have a rule of their own for dual lanes."""
    controller = lw.Controller(
        period=0.1,
        guidance=[lw.control.SetPoint(position=[0.0] * 3, heading=0.0)],
        laws=[lw.control.StateFeedback(K=-np.eye(12)[[0, 1, 2, 9, 10, 11]])],
        allocation=[lw.control.BoundedLeastSquares(to="thrusters")],
    )

    def command(x, **more):
        scene = lw.Scene.named("bluerov2_heavy", controller=controller, start={"position": [x, 30.0, 20.0]})
        return lw.solve(scene, "rk4", h=0.1, t1=0.1, save=lw.SaveAt(every=0.1, fields=("command",)), **more)

    found = command(90.0, tangents=["start.position[0]"]).jacobian["command"][0, 0]
    shift = 1e-4
    ahead, behind = (command(90.0 + side * shift).command[0, 0] for side in (1.0, -1.0))
    assert np.count_nonzero(np.abs(ahead) > 0.97) == 2
    # Differences of commands are good to their round-off over the shift.
    np.testing.assert_allclose(np.ravel(found), (ahead - behind) / (2.0 * shift), atol=1e-9)


@pytest.mark.ci
def test_a_predictive_law_at_its_limits_against_differences():
    """Its iterations divide a number by a lane, which Warp's own quotient did slope by slope."""
    T, shift = 0.1, 1e-4
    law = lw.control.LinearMPC(states=["position[2]", "velocity[2]"], inputs=["Z"], A=[[1.0, T], [0.0, 1.0]],
                               B=[[T * T / 40.0], [T / 20.0]], Q=[1.0, 0.0], R=[1e-4], limit=[30.0], rate_limit=[60.0],
                               horizon=3)  # fmt: skip
    controller = lw.Controller(period=T, guidance=[lw.control.SetPoint(depth=3.0)], laws=[law],
                               allocation=[lw.control.PseudoInverse(to="thrusters")])  # fmt: skip

    def demand(z, **more):
        scene = lw.Scene.named("bluerov2_heavy", controller=controller, start={"position": [0.0, 0.0, z]})
        return lw.solve(scene, "rk4", h=T, t1=4 * T, save=lw.SaveAt(every=T, fields=("demand",)), **more)

    found = demand(2.0, tangents=["start.position[2]"]).jacobian["demand"].reshape(5, 6)[:, 2]
    ahead, behind = (demand(2.0 + side * shift).demand[:, 0, 2] for side in (1.0, -1.0))
    # At the limit of the rate at first, then free; demands are good to 1e-8 of their limit.
    assert np.all(np.abs(found[:2]) < 1e-6)
    assert np.all(np.abs(found[2:]) > 1.0)
    np.testing.assert_allclose(found, (ahead - behind) / (2.0 * shift), rtol=1e-4, atol=30.0 * 1e-8 / shift)


@pytest.mark.slow
def test_one_name_may_stand_alone():
    result = lw.solve(falling(), "rk8", h=0.02, t1=0.1, tangents=" start.velocity[ 0 ] ", threads=1)
    assert result.tangents == ("start.velocity[0]",)


@pytest.mark.slow
def test_a_number_that_changes_nothing_is_refused():
    with pytest.raises(lw.SceneError, match="changes nothing that a run computes with"):
        lw.solve(looped(), "rk8", h=PERIOD / 2, t1=1.0, tangents=["environment.water_density"])


@pytest.mark.ci
def test_axes_that_jump_are_refused():
    # psi_s works in principal axes, and two equal moments of inertia leave these open: a product of inertia turns them by 45
    # degrees, however small it is.
    vehicle = lw.Vehicle(20.0, inertia=(2.0, 2.0, 3.0), added_mass=(10.0,) * 3, buoyancy=200.0, center_of_buoyancy=NONE)
    base = free()
    scene = lw.Scene(vehicle, base.environment, start=base.start)
    with pytest.raises(lw.SceneError, match="kink or a jump"):
        lw.solve(scene, "psi_s", h=0.02, t1=1.0, tangents=["vehicle.inertia[0,1]"])


TUMBLING = lw.Start(NONE, euler_deg=(10.0, 20.0, 30.0), velocity=(0.5, -0.2, 0.1), angular_velocity=(0.3, 0.2, 0.8))
PRODUCTS = ((0, 1), (0, 2), (1, 2))


@pytest.mark.ci
@pytest.mark.slow_but("*-psi_s")
@pytest.mark.parametrize("kind", ["psi_s", "psi_x", "rk4", "drag"])
@pytest.mark.parametrize("moments", [(1.0, 3.0, 4.0), (4.0, 1.5, 3.0)])
def test_axes_of_copies_go_on_from_those_of_the_member(kind, moments):
    # A diagonal inertia keeps the axes of the vehicle; its copies get principal axes in another order, and of other senses.
    vehicle = lw.Vehicle(20.0, inertia=moments, added_mass=(3.0, 15.0, 25.0), buoyancy=200.0)
    drag = lw.terms.Drag(linear=(1.0, 2.0, 3.0, 0.1, 0.2, 0.3), quadratic=(3.0, 2.0, 1.0, 0.3, 0.2, 0.1))
    scene = lw.Scene(vehicle, start=TUMBLING, terms=[drag] if kind == "drag" else [])
    sizes = {f"vehicle.inertia[{i},{j}]": 1.0 for i, j in PRODUCTS}
    assert_agree(scene, sizes, "rk4" if kind == "drag" else kind, 1e-9, h=0.02, t1=1.0, threads=1)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_x", "rk4"])
def test_axes_of_copies_of_a_coupled_body(method):
    lever = 20.0 * 0.1 * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    rigid = np.block([[20.0 * np.eye(3), lever.T], [lever, np.diag([4.2, 1.7, 3.0])]])
    vehicle = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=np.diag([3.0, 15.0, 25.0, 0.5, 0.1, 0.2]),
                         weight=200.0, center_of_gravity=(0.0, 0.0, 0.1), buoyancy=200.0)  # fmt: skip
    sizes = {f"vehicle.rigid_body_mass_matrix[{3 + i},{3 + j}]": 1.0 for i, j in PRODUCTS}
    assert_agree(lw.Scene(vehicle, start=TUMBLING), sizes, method, 1e-9, h=0.02, t1=1.0, threads=1)


def slopes_of(values):
    """Slopes of a packed number, out of it and its six copies a step of 1 apart."""
    copies = SimpleNamespace(targets=(Target("vehicle.mass"),))
    slopes = Slopes(SimpleNamespace(ensemble=SimpleNamespace(copies=copies), spec=None))
    slopes.begin(SimpleNamespace(steps=np.ones((1, 1))))
    return slopes.of(np.array(values))[1][0]


def test_round_off_is_no_kink_and_a_member_apart_is_one():
    np.testing.assert_allclose(slopes_of([0.0, 5e-18, -5e-18, 0.0, 0.0, 5e-18, 0.0]), 0.0, atol=1e-16)
    line = [0.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0]
    np.testing.assert_allclose(slopes_of(line), 1.0, rtol=1e-15)
    with pytest.raises(lw.SceneError, match="kink or a jump"):
        slopes_of([1e-3, *line[1:]])


@pytest.mark.slow
def test_a_sensor_that_rounds_is_told():
    scene = looped(quantum=0.05)
    result = lw.solve(scene, "rk8", h=PERIOD / 2, t1=1.0, tangents=["pose_pid.kp[0]"], threads=1)
    assert "fix rounds" in result.messages[-1]


def test_no_function_of_lanes_is_without_a_rule():
    # What is written in C++ is replaced, or it moves lanes as a whole, whatever they hold; all else is made of such.
    shape = DualShape(4, 2, wp.float64)
    L = lane(declare(shape), wp.float64)
    moved = {"entry_of", "set_element", "gathered"}
    unknown = set()
    for module in (arithmetic, functions, noise, sums):
        for name, family in vars(module).items():
            overloads = getattr(family, "user_overloads", {}).values() if isinstance(family, wp.Function) else ()
            for overload in overloads:
                own = overload.native_snippet in snippets(shape).values()
                if overload.native_snippet and L in overload.input_types.values() and not own:
                    unknown.add(name)
    # Three plain lanes side by side may be as long as a dual one: `third` takes one of them out, as it is.
    assert unknown - {"third"} == moved


@pytest.mark.ci
def test_warps_adjoint_gives_silent_zeros():
    # Native functions have no adjoint there: a gradient by a tape of Warp's would be 0, and not an error.
    Lane = lane(2, wp.float64)

    @wp.kernel(module="unique")
    def squared(x: wp.array(dtype=Lane), y: wp.array(dtype=Lane)):
        y[0] = x[0] * x[0]

    x, y = (wp.array([values], dtype=Lane, device="cpu", requires_grad=True) for values in ((3.0, 4.0), (0.0, 0.0)))
    with wp.Tape() as tape:
        wp.launch(squared, dim=1, inputs=[x, y], device="cpu")
    tape.backward(grads={y: wp.array([(1.0, 1.0)], dtype=Lane, device="cpu")})
    np.testing.assert_array_equal(y.numpy(), [[9.0, 16.0]])
    np.testing.assert_array_equal(x.grad.numpy(), [[0.0, 0.0]])


@pytest.mark.slow
def test_commands_through_polynomials_of_thrust_have_slopes():
    """A gain whose demand goes to the thrusters by the inverse of their polynomials, against differences of plain runs."""
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(depth=6.0)], laws=[lw.control.HeavePID(kp=80.0, ki=1.0, kd=40.0)],
        allocation=[lw.control.PseudoInverse(to="thrusters")])  # fmt: skip
    scene = lw.Scene.named("bluerov2_heavy", start={"position": [0.0, 0.0, 5.0]}, controller=controller)
    run, e = {"method": "rk4", "h": 0.05, "t1": 2.0, "save": lw.SaveAt(every=1.0)}, 1e-3
    slope = lw.solve(scene, tangents=["heave_pid.kp"], **run).jacobian["position"][-1].ravel()[2]
    below, above = (lw.solve(scene.with_numbers({"heave_pid.kp": 80.0 + d}), **run).position[-1, 0, 2] for d in (-e, e))
    # The cubic's part is (e / kp)^2, and round-off 1e-15 / e.
    assert slope == pytest.approx((above - below) / (2.0 * e), rel=1e-8)
