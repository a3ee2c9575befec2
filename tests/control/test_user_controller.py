# SPDX-License-Identifier: Apache-2.0
"""Parts of a controller from a user's own file, and check_controller, which says what is wrong with them."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, div, lane, mul, neg, ones, positive, remember, struct, sub  # noqa: F401
from lgvi_warp.reference.control import fault, heading_pid, matrix, set_point
from lgvi_warp.scene import scene as scenes
from tests.conftest import ROOT
from tests.laws.test_user_law import load


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The example of the page, as a file of its own."""
    text = (ROOT / "docs" / "develop" / "add_a_controller.md").read_text().split("## Four roles")[0]
    code = "\n".join(line[4:] for line in text.splitlines() if line.startswith("    ") or not line)
    yield load(tmp_path_factory.mktemp("page") / "page_of_controllers.py", code)
    del lw.laws.ControlLaw.kinds["bang"]


def wrong_checks(report):
    return {check.name.partition(": ")[2] or check.name: check.text for check in report.checks if not check.ok}


SCENE = """
terms = [{ type = "control_wrench" }, { type = "drag", linear = [20.0, 20.0, 20.0, 5.0, 5.0, 5.0] }]
run = { step = 0.05, duration = 20.0 }
[vehicle]
mass = 20.0
added_mass = [5.0, 22.0, 25.0]
inertia = [1.5, 4.0, 4.5]
buoyancy = 196.2
center_of_buoyancy = [0.0, 0.0, -0.02]
[controller]
period = 0.1
guidance = [{ type = "set_point", depth = 1.0 }]
laws = [{ type = "bang", level = 3.0 }]
[ensemble]
members = 3
vary = { "bang.level" = { uniform = { low = 2.0, high = 4.0 } } }
"""


@pytest.mark.slow
def test_the_law_on_the_page_is_right_and_keeps_the_depth(page):
    report = lw.laws.check_controller(page.Bang(level=3.0))
    assert report.ok, str(report)
    assert "nanoseconds" in str(report), str(report)
    scene = scenes.loads(SCENE)
    assert isinstance(scene.controller.laws[0], page.Bang)
    assert "bang.level" in scene.parameters()
    result = lw.solve(lw.Ensemble.from_scene(scene))
    # It swings around the depth: a period at 0.2 m/s, the speed at which drag balances it, and a bit.
    assert result.status.counts() == {"ok": 3}
    assert np.abs(result.position[-1, :, 2] - 1.0).max() < 0.1


def test_a_type_is_taken_once(monkeypatch):
    for base, word in (
        (lw.laws.ControlLaw, "heading_pid"),
        (lw.laws.Guidance, "waypoints"),
        (lw.laws.MeasuringPart, "sensor"),
    ):
        monkeypatch.setattr(base, "kinds", dict(base.kinds))
        taken = type("Mine", (base,), {"type": word})
        with pytest.raises(
            ValueError, match=rf"Mine.type = '{word}' is that of lgvi_warp\..*. Give a type that no other"
        ):
            lw.laws.register(taken)
        assert base.kinds[word] is not taken
    # A type is one list's: a law may have the type of a guidance.
    assert lw.laws.register(type("Mine", (lw.laws.ControlLaw,), {"type": "waypoints"}))


@wp.func
def careless_control(w: Any, r: Any, y: Any, p: Any):
    e = r.position.z - y.b.z
    mean = y.h.dtype(0.5) * (e + element_of_first(e))
    remember(y, p.memory + 1, e)
    remember(y, 0, e)
    w.force = w.force + (mean / p.level) * y.down
    return w


@wp.func
def element_of_first(e: Any):
    return ones(e) * e[0]


class Careless:
    control = careless_control

    @staticmethod
    def params(width, real):
        return struct("Careless", level=lane(width, real), memory=wp.int32)


@dataclass(frozen=True, eq=False, kw_only=True)
class CarelessLaw(lw.laws.ControlLaw):
    device: ClassVar[Any] = Careless

    type: ClassVar[str] = "careless_of_tests"
    level: Any = lw.laws.number((), "N", least=0.0)

    def packed(self, numbers, context):
        turned = context.frame.vector(np.ones((1, 3)))[:, 0] * numbers["level"]
        return lw.laws.Packed({"level": turned}, memory=np.zeros((1, 1)))


class Forgetful(CarelessLaw):
    type: ClassVar[str] = "forgetful_of_tests"

    def packed(self, numbers, context):
        return lw.laws.Packed({"level": numbers["level"][:1]}, memory=np.zeros((1, 1)))


@pytest.mark.ci
def test_what_is_wrong_is_said():
    wide = scenes.loads(SCENE.replace("bang", "heading_pid").replace("level = 3.0", "kp = 1.0").split("[ensemble]")[0]
                        .replace("depth = 1.0", "heading = 1.0"))  # fmt: skip
    report = lw.laws.check_controller(CarelessLaw(level=2.0), scene=wide)
    wrong = wrong_checks(report)
    assert set(wrong) == {
        "finite at bounds of numbers", "lanes apart", "packets of one", "blind to the truth", "any axes", "memory in its rows"
    }, str(report)  # fmt: skip
    assert "above=0.0" in wrong["finite at bounds of numbers"]
    assert "y.position" in wrong["blind to the truth"]
    assert "varied numbers" in wrong_checks(lw.laws.check_controller(Forgetful(level=2.0), scene=wide))
    assert "p.memory + 1" in wrong["memory in its rows"]
    assert "user's axes" in wrong["any axes"]


GAINS = dict(kp=1.0, ki=0.2, kd=0.3, integral_limit=0.05)


@pytest.mark.ci
def test_a_twin_agrees_or_is_said_to_differ():
    part = lw.control.HeadingPID(**GAINS)
    assert lw.laws.check_controller(part, twin=heading_pid.HeadingPID(**GAINS)).ok
    other = lw.laws.check_controller(part, twin=heading_pid.HeadingPID(**GAINS | {"ki": 0.21}))
    assert set(wrong_checks(other)) == {"as the twin"}


@wp.func
def shapeless_control(w: Any, r: Any, y: Any, p: Any):
    return w + p.nothing


@pytest.mark.ci
def test_what_is_no_part_or_does_not_compile_is_refused():
    with pytest.raises(lw.SceneError, match=r"is not a part of a controller. Give an object"):
        lw.laws.check_controller(lw.control.HeadingPID)
    with pytest.raises(lw.SceneError, match="is not a part of a controller"):
        lw.laws.check_controller(lw.terms.Current(velocity=(1.0, 0.0, 0.0)))
    device = type("Shapeless", (), {"control": shapeless_control})
    kind = type("ShapelessLaw", (lw.laws.ControlLaw,), {"device": device})
    with pytest.raises(lw.SceneError, match=r"does not compile.*add_a_controller\.md"):
        lw.laws.check_controller(kind(name="shapeless"))
    empty = type("EmptyLaw", (lw.laws.ControlLaw,), {"device": type("Empty", (), {})})
    with pytest.raises(lw.SceneError, match=r"has none of measure.*add_a_controller\.md"):
        lw.laws.check_controller(empty(name="empty"))


V = (0.3, 0.4, 0.5)
PARTS = {
    "depth sensor": (lw.control.Sensor(of="depth", noise=0.02, quantum=0.005, bias=0.1), None),
    "heading sensor": (lw.control.Sensor(of="heading", noise=0.01, drift=0.1, every=3, latency=2, dropout=0.1), None),
    "attitude sensor": (lw.control.Sensor(of="attitude", noise=0.01, latency=1), None),
    "dead reckoning": (lw.control.DeadReckoning(), None),
    "low-pass": (lw.control.LowPass(of="attitude", time_constant=0.5), None),
    "complementary": (lw.control.ComplementaryFilter(time_constant=2.0), None),
    "set-point": (lw.control.SetPoint(depth=3.0, speed=1.0), set_point.SetPoint(depth=3.0, speed=1.0)),
    "place": (lw.control.SetPoint(position=(1.0, -2.0, 3.0), heading=0.4),
              set_point.SetPoint(position=(1.0, -2.0, 3.0), heading=0.4)),
    "waypoints": (lw.control.Waypoints(points=[(0, 0, 5), (9, 0, 5), (9, 9, 6)], speed=1.0, look_ahead=3.0, radius=1.0), None),
    "trajectory": (lw.control.Trajectory(times=(0.1, 0.2, 0.3), positions=[(0, 0, 3), (2, 1, 4), (5, -2, 6)]), None),
    "reference model": (lw.control.ReferenceModel(natural_frequency=(1, 1.2, 0.8, 1.5), damping_ratio=(1, 0.8, 1.2, 1)), None),
    "depth": (lw.control.DepthPID(kp=0.3, ki=0.02, kp_pitch=12.0), None),
    "heave": (lw.control.HeavePID(kp=3.0, ki=0.2), None),
    "speed": (lw.control.SpeedPID(kp=3.0, ki=0.2), None),
    "pose": (lw.control.PosePID(kp=V, ki=V, kd=V, kr=V, kw=V, feedforward="restoring"), None),
    "pose smc": (lw.control.PoseSMC(lambda_=V, boundary=V, lambda_r=V, boundary_r=V, k_sigma=V, k_d=V, k_sigma_r=V,
                                    k_d_r=V), None),
    "heading smc": (lw.control.HeadingSMC(lambda_=0.4, boundary=0.1, k_sigma=0.2, nomoto_gain=0.25, nomoto_time=1.5), None),
    "state feedback": (lw.control.StateFeedback(K=np.ones((6, 12))), None),
    "loiter": (lw.control.Loiter(center=(1, 2, 3), radius=4.0, speed=1.0, look_ahead=2.0), None),
    "docking": (lw.control.Docking(position=(1, 2, 3), heading=0.4, speed=1.5, contact_speed=0.5, slowing=9.0, look_ahead=3.0,
                                   mouth=0.5, funnel=0.2, approach=20.0, judged=5.0), None),
    "matrix": (lw.control.AllocationMatrix(to="control_wrench", matrix=2.0 * np.eye(6)),
               matrix.AllocationMatrix(to="control_wrench", matrix=2.0 * np.eye(6))),
    "pseudo-inverse": (lw.control.PseudoInverse(to="control_wrench"), None),
    "fault": (lw.control.Fault(of="control_wrench", channel=2, gain=0.5), None),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.slow_but("place")
@pytest.mark.parametrize("name", PARTS)
def test_the_parts_of_the_package_are_right(name):
    part, twin = PARTS[name]
    report = lw.laws.check_controller(part, twin=twin)
    assert report.ok, str(report)
    assert not any("note: changes nothing" in check.text for check in report.checks), str(report)


@pytest.mark.ci
@pytest.mark.slow_but("2")
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_fault_of_a_sensor_is_its_twin(channel):
    numbers = {"channel": channel, "gain": 0.5, "offset": 0.3}
    sensed = lw.Controller(period=0.1, sensors=[lw.control.Sensor(of="velocity")], laws=[lw.control.SpeedPID(kp=1.0)],
                           guidance=[lw.control.SetPoint(speed=1.0)])  # fmt: skip
    scene = lw.Scene.named("torpedo", terms=[lw.terms.ControlWrench()], controller=sensed)
    twin = fault.SensorFault(**numbers, of="velocity", time=0.0)
    report = lw.laws.check_controller(lw.control.Fault(of="sensor", **numbers), scene=scene, twin=twin)
    assert report.ok, str(report)
    assert not any("note: changes nothing" in check.text for check in report.checks), str(report)
