# SPDX-License-Identifier: Apache-2.0
"""Compositions, of whole methods, of their halves and of two parts: the kernel against the twin."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.method import COMPOSITIONS, HALVES, PROGRAMS, TWO_PART
from lgvi_warp.methods.modified_inertia import series
from lgvi_warp.reference import advance, coupled, near_integrable, rotation
from lgvi_warp.reference.coupled import Direction
from tests.methods.test_coupled import INERTIA
from tests.methods.test_coupled import STATE as COUPLED_STATE
from tests.methods.test_coupled import body_of as coupled_body_of
from tests.methods.test_coupled import scene_of as coupled_scene_of
from tests.methods.test_kernel_and_twin import SHAPES, STATE
from tests.support.tools import body_of, difference, from_state, last, one, scene_of, to_state

# A few steps of some hundreds to thousands of operations.
STEPS, ROUND_OFF = 4, 1e-12
# u = 6e-8 some three times a map in up to 84 maps and a few steps, as a random walk, and the samples' rounding.
SINGLE = 5e-6
BOX = lw.events.Box(lower=[-1e4] * 3, upper=[1e4] * 3)


def kernel(method, shape="diagonal", h=0.1, dtype="float64", steps=STEPS, events=(), width=None):
    """The kernel's state after some steps, and the twin's body and start."""
    scene = scene_of(*SHAPES[shape], net=-2.56, moment=(0.3, -0.2, -8.5))
    scene = lw.Scene(scene.vehicle, scene.environment, events=list(events))
    result = lw.solve(one(scene, **STATE), method, h=h, t1=steps * h, dtype=dtype, width=width)
    assert result.status.counts() == {"ok": 1}
    body = body_of(scene)
    return last(result), body, to_state(body, *(np.array(value) for value in STATE.values()))


def halves(program, name):
    """chi over a_1, chi* over a_2, ... as one program: the first half of a symmetric one, and its mirror image."""
    a = HALVES[name][1]
    n = len(program) // 2
    chi = [(letter, 2.0 * c if i < n else c) for i, (letter, c) in enumerate(program[: n + 1])]
    return [
        (letter, c * b)
        for i, b in enumerate((*a, *reversed(a)))
        for letter, c in (chi if i % 2 == 0 else reversed(chi))
    ]  # fmt: skip


def merged_parts(name):
    """The first of both parts opens, then every step ends with its last and the next one's first as one."""
    program = near_integrable.PROGRAMS[name]
    (part, first), (_, final) = program[0], program[-1]
    return (part, first), (*program[1:-1], (part, final + first)), (part, -first)


@pytest.mark.slow_for("*-float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("name", COMPOSITIONS)
def test_compositions(name, dtype):
    end, body, x = kernel(f"{name}(psi_s)", dtype=dtype)
    x = advance.advance(x, body, PROGRAMS["psi_s"], 0.1, STEPS, COMPOSITIONS[name][1], rotation.quartic)
    assert difference(end, from_state(body, x)) < (ROUND_OFF if dtype == "float64" else SINGLE)


@pytest.mark.ci
@pytest.mark.slow_but("bm6(psi)-*")
@pytest.mark.parametrize(("method", "dtype"), [("bm4(psi_s)", "float64"), ("bm6(psi_s)", "float64"),
                                               ("bm6(psi)", "float64"), ("bm6(psi_s)", "float32")])  # fmt: skip
def test_halves(method, dtype):
    name, base = method[:-1].split("(")
    end, body, x = kernel(method, dtype=dtype)
    x = advance.advance(x, body, halves(PROGRAMS[base], name), 0.1, STEPS, solve=rotation.quartic)
    assert difference(end, from_state(body, x)) < (ROUND_OFF if dtype == "float64" else SINGLE)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "program"), [("bm4(psi_x)", "x6"), ("bm6(psi_x)", "x6"), ("bm4(psi_x8)", "x8"),
                                                 ("bm4(psi_w)", "psi_w")])  # fmt: skip
def test_halves_with_coupled_inertia(method, program):
    result = lw.solve(one(coupled_scene_of(()), **COUPLED_STATE), method, h=0.05, t1=0.05 * STEPS)
    body, reduced = coupled_body_of(()), coupled.reduce(INERTIA, program)
    x = reduced.to_reduced(*(np.array(value) for value in COUPLED_STATE.values()))
    for _ in range(STEPS):
        maps = halves(coupled.PROGRAMS[program], method[:3])
        x = coupled.step(x, reduced, 0.05, maps, lambda b, R: body.wrench(b, R))
    assert result.status.counts() == {"ok": 1}
    assert difference(last(result), reduced.from_reduced(x)) < ROUND_OFF


@pytest.mark.slow
def test_halves_with_drag():
    # A kick with drag is symmetric but no flow: each half has its own.
    linear, quadratic = np.array([20.0, 60.0, 60.0, 4.0, 6.0, 6.0]), np.array([20.0, 80.0, 80.0, 3.0, 5.0, 5.0])
    terms = [lw.terms.Drag(linear=linear, quadratic=quadratic)]
    scene = scene_of(*SHAPES["diagonal"], net=-2.56, moment=(0.3, -0.2, -8.5))
    scene = lw.Scene(scene.vehicle, scene.environment, terms=terms)
    result = lw.solve(one(scene, **STATE), "bm4(psi_x)", h=0.1, t1=0.1 * STEPS)
    body = body_of(scene)
    reduced = coupled.reduce(np.diag([*np.diag(SHAPES["diagonal"][0]), 5.46, 5.29, 5.72]), "x6")
    directions = [Direction(z, a, b) for z, a, b in zip(np.eye(6), linear, quadratic)]

    def kick(b, R, p, pi, k):
        f, m = body.wrench(b, R)
        y = reduced.momenta_about(1, b, R, p + 0.5 * k * f, pi + 0.5 * k * m)
        b, R, p, pi = reduced.momenta_about_user(coupled.E(y, reduced, k, directions), 1)
        return b, R, p + 0.5 * k * f, pi + 0.5 * k * m

    x = reduced.to_reduced(*(np.array(value) for value in STATE.values()))
    for _ in range(STEPS):
        x = coupled.step(x, reduced, 0.1, halves(coupled.PROGRAMS["x6"], "bm4"), None, kick=kick)
    assert difference(last(result), reduced.from_reduced(x)) < ROUND_OFF


@pytest.mark.ci
@pytest.mark.slow_but("*-diagonal-*")
@pytest.mark.parametrize(
    ("shape", "dtype"),
    [("diagonal", "float64"), ("isotropic mass", "float64"), ("both full", "float64"), ("both full", "float32")],
)
@pytest.mark.parametrize("name", TWO_PART)
def test_two_parts(name, shape, dtype):
    # h |Om| = 0.3.
    end, body, x = kernel(name, shape, h=0.3, dtype=dtype)
    opening, step, closing = merged_parts(name)
    for program in ((opening,), *[step] * STEPS, (closing,)):
        x = near_integrable.step(x, body, program, 0.3, order=8)
    assert difference(end, from_state(body, x)) < (ROUND_OFF if dtype == "float64" else SINGLE)


@pytest.mark.ci
@pytest.mark.slow_for("rkn6_11")
@pytest.mark.parametrize("method", ["bm4(psi_x)", "rkn6_11", "rkn6_14"])
def test_events_change_round_off_only(method):
    # One lane, which is sooner compiled.
    # With an event no map is joined to the next step's; A joins to its order, 8: at h |Om| = 0.1 that is 1e-10 of a turn.
    plain, watched = kernel(method)[0], kernel(method, events=[BOX], width=1)[0]
    assert difference(plain, watched) < (1e-10 if method == "rkn6_14" else 1e-13)


def test_series_of_the_modified_inertia():
    J = np.random.default_rng(3).uniform(0.1, 1.0, (5, 3))
    mine = series(J)
    for i, moments in enumerate(J):
        printed = near_integrable.coefficients(moments)[:3]
        for k in range(2):
            np.testing.assert_allclose([c[i] for c in mine[k]], np.concatenate([one[k] for one in printed]), rtol=1e-12)
