# SPDX-License-Identifier: Apache-2.0
"""The last line of every verb that answers, on four scenes with closed forms: a sentence with the right numbers."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from statistics import NormalDist

import pytest

from lgvi_warp import cli

pytestmark = pytest.mark.slow_but("falling")
TIME, STD = 2.0, 0.1
MASS, LINEAR = 2.0, 1.0
SIX = [LINEAR] * 6
SPHERE = "vehicle = { mass = 2.0, inertia = [1.0, 1.0, 1.0], buoyancy = 19.6133 }\n"
RELAXED = (1.0 - math.exp(-LINEAR * TIME / MASS)) * MASS / LINEAR


class Case:
    """A scene whose quantity is linear in one number: value = at_mean + slope * (number - mean).

    carried: whether a spread of the number spreads the places where members end, along north.
    """

    def __init__(self, text, of, number, mean, at_mean, slope, unit, of_unit, carried=False):
        self.text, self.of, self.number, self.mean, self.carried = SPHERE + text, of, number, mean, carried
        self.at_mean, self.slope, self.unit, self.of_unit = at_mean, slope, unit, of_unit

    def at(self, number):
        return self.at_mean + self.slope * (number - self.mean)


CASES = {
    "falling": Case("start = { velocity = [0.0, 0.0, 0.5] }\n",
                    "depth", "start.velocity[2]", 0.5, 1.0, TIME, "m/s", "m"),
    "carried": Case(f"terms = [{{ type = 'current', velocity = [0.3, 0.0, 0.0] }}, {{ type = 'drag', linear = {SIX} }}]\n",
                    "position[0]", "current.velocity[0]", 0.3, 0.3 * (TIME - RELAXED), TIME - RELAXED, "m/s", "m", True),
    # Half the square of the time by a surplus of weight of 2 N on 2 kg.
    "heavy": Case("", "depth", "vehicle.buoyancy", 17.6133, 2.0, -TIME**2 / (2.0 * MASS), "N", "m"),
    "turning": Case("start = { angular_velocity = [0.0, 0.0, 0.2] }\n",
                    "euler[2]", "start.angular_velocity[2]", 0.2, 0.4, TIME, "rad/s", "rad"),
}  # fmt: skip
CASES["heavy"].text = CASES["heavy"].text.replace("19.6133", "17.6133")


@pytest.fixture(params=CASES)
def case(request, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = CASES[request.param]
    vary = (
        f'[ensemble]\nmembers = 200\nseed = 4\n[ensemble.vary]\n"{found.number}" = {{ normal = {{ std = {STD} }} }}\n'
    )
    (tmp_path / "one.toml").write_text(f'{found.text}run = {{ method = "rk4", step = 0.05, duration = {TIME} }}\n')
    (tmp_path / "fleet.toml").write_text((tmp_path / "one.toml").read_text() + vary)
    return found


@pytest.fixture
def line(capsys):
    """The last line of a verb, the same as its answer in JSON, read as one sentence."""

    def last(verb, *arguments):
        assert cli.main([verb, *arguments, "--out", f"out_{verb}"]) == 0
        text = capsys.readouterr().out.splitlines()[-1]
        assert re.fullmatch(r"(\S.*[^.\s])\.", text)
        assert not re.search(r"\bnan\b|None|\bof of\b|  |\( ?\)", text)
        saved = [json.loads(path.read_text()).get("answer") for path in Path(f"out_{verb}").glob("*.json")]
        assert text in saved or not any(saved)
        return text

    return last


def numbers(text):
    return [float(word) for word in re.findall(r"(?<![\w.\[])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", text.replace(",", ""))]


def near(text, *expected, rel=6e-3):
    found = iter(numbers(text))
    for value in expected:
        assert any(each == pytest.approx(value, rel=rel, abs=1e-12) for each in found), (value, text)


def interval(text):
    low, high = re.search(r"95 % interval (\S+) to ([^\s;,)]*[^\s;,).])", text).groups()
    return float(low), float(high)


@pytest.mark.ci
def test_a_run_and_its_footprint(case, line, capsys):
    text = line("run", "fleet.toml")
    assert text.startswith("All 200 members end ok at 2 s")
    if not case.carried:
        assert text == "All 200 members end ok at 2 s."
        cli.main(["footprint", "out_run"])
        place = "at the origin."
        assert capsys.readouterr().out.splitlines()[-1] == f"All end {place}"
    else:
        # Places on a line: 95 % lie within 1.96 standard deviations, of which 200 members give a tenth or so.
        within, north = re.search(r"95 % end within (\S+) m of a point (\S+) m north of the origin\.", text).groups()
        spread = case.slope * STD
        assert float(within) == pytest.approx(1.96 * spread, rel=0.25)
        assert float(north) == pytest.approx(case.at_mean, abs=4.0 * spread / math.sqrt(200))


@pytest.mark.ci
def test_an_estimate(case, line):
    text = line("estimate", "fleet.toml", "--of", case.of, "--error", "0.01")
    assert text.startswith(f"mean {case.of} is ")
    low, high = interval(text)
    assert low <= case.at_mean <= high
    assert "0.01 requested." in text


@pytest.mark.ci
def test_a_rare_event(case, line):
    sign = math.copysign(1.0, case.slope)
    bound = case.at(case.mean + sign * 4.0 * STD)
    text = line("rare", "fleet.toml", "--limit", f"{case.of} above {bound}", "--relative-error", "0.2")
    assert text.startswith(f"Probability of {case.of} above ")
    low, high = interval(text)
    assert low <= 1.0 - NormalDist().cdf(4.0) <= high
    side = "above" if case.slope > 0.0 else "below"
    assert re.search(rf"{re.escape(case.number)} is on average \S+ standard deviations {side} ", text)
    # The mean beyond 4 standard deviations of a normal distribution.
    beyond = NormalDist().pdf(4.0) / (1.0 - NormalDist().cdf(4.0))
    near(text.partition("on average")[2], beyond, rel=0.05)


@pytest.mark.ci
def test_sensitivity_and_derivatives(case, line):
    text = line("sensitivity", "fleet.toml", "--of", case.of, "--samples", "256", "--duration", "2")
    assert text.startswith(f"{case.of} depends most on {case.number} (")
    assert "then on" not in text
    text = line("derivatives", "one.toml", "--of", case.of, "--by", case.number)
    assert text.startswith(f"{case.of} changes by ")
    assert text.endswith(f" per {case.unit} of {case.number}.")
    near(text, case.slope)
    assert f" {case.of_unit} " in text


@pytest.mark.ci
def test_a_worst_case_and_the_best_number(case, line):
    low, high = case.mean - 0.1, case.mean + 0.1
    best, worst = (low, high) if case.slope > 0.0 else (high, low)
    text = line("worst-case", "one.toml", "--of", case.of, "--within", f"{case.number}={low}:{high}", "--budget", "64")
    assert text.startswith(f"The largest {case.of} found is ")
    near(text, case.at(worst), worst, 64)
    assert f"(its {'upper' if case.slope > 0.0 else 'lower'} bound)" in text
    text = line(
        "tune-gains", "one.toml", "--minimise", case.of, "--over", f"{case.number}={low}:{high}", "--budget", "64"
    )
    assert text.startswith(f"mean of {case.of} is ")
    near(text, case.at(best), best, case.mean)
    assert f"{case.number} " in text


@pytest.mark.ci
def test_a_sweep(case, line, tmp_path):
    values = [case.mean - 0.1, case.mean, case.mean + 0.1]
    grows = case.slope > 0.0
    bound = case.at(case.mean + (0.05 if grows else -0.05))
    corners = f"lower = [-9.0, -9.0, -9.0], upper = [{bound}, 9.0, 9.0]"
    event = {"depth": f"'floor', depth = {bound}", "position[0]": f"'box', {corners}"}
    ends = f"\nevents = [{{ type = {event[case.of]} }}]\n" if case.of in event else ""
    (tmp_path / "ends.toml").write_text((tmp_path / "one.toml").read_text().replace("run =", f"{ends}run ="))
    (tmp_path / "sweep.toml").write_text(f'scene = "ends.toml"\nmembers = 20\n[grid]\n"{case.number}" = {values}\n')
    text = line("sweep", "sweep.toml")
    assert "members reach the end" in text
    if not ends:
        assert text.startswith("In all 3 cells 100 % (")
        return
    best, worst = text.split("; worst: ")
    near(best, *(values[:2] if grows else values[1:]), 100.0, 100.0, 20)
    near(worst, values[2] if grows else values[0], 0.0, 0.0)


@pytest.mark.ci
def test_what_methods_cost_and_where_they_hold(case, line):
    text = line(
        "tradeoff", "one.toml", "--of", "position", "--methods", "psi_x,rk4", "--duration", "1", "--seconds", "10"
    )
    assert re.match(r"For position (the cheapest is|\w+ float\d+ at .* is the cheapest and the most accurate) ", text)
    text = line("stability", "one.toml", "--duration", "1", "--methods", "psi_x,rk4", "--points", "4")
    assert text.startswith("Runs with ")
    assert "stay bounded without a flag in " in text
