# SPDX-License-Identifier: Apache-2.0
"""Broken scene files: every one is accepted, or refused with SceneError naming a key; and never anything else.

python -m tests.extremes.fuzz KIND FIRST STOP KERNELS writes one line of JSON per case, so that the last line tells which
case hung or killed the process. Kinds: "files" (bytes and tokens of scene files), "set" (--set of the command line),
"controllers" (bytes and tokens of the controller section of scene files).
KERNELS: accepted scenes are run for two steps if they need the paper's kernel or one of so many others: each takes seconds.
"""

import contextlib
import faulthandler
import functools
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

import numpy as np

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.engine import kernel as kernel_of_run
from lgvi_warp.physics import terms
from lgvi_warp.physics.terms import events
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene import settings
from lgvi_warp.scene.scene import SECTIONS
from tests.support.pages import blocks

ROOT = Path(__file__).parents[2]

# A case that takes longer hangs: whole files are read in milliseconds, and a fleet of a million members is drawn in seconds.
SECONDS = 60
# What a case may take in memory; a request beyond it raises MemoryError, which no scene file may.
BYTES = 8 << 30
# Scenes with more members are read only, with more than the second number planned only. All members are looked at when a
# file is read: of the most there can be that takes minutes, so that the third is the most there can be here.
MOST_PLANNED, MOST_RUN, MOST_READ = 1_000_000, 5000, 100_000_000

NUMBERS = [
    "0", "-0.0", "1", "-1", "2", "3.5", "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "1e400", "1e38",
    "1e-38", "9223372036854775808", "-9223372036854775809", "1e5", "1e-9", "0x7fffffff", "1_000", "1__0",
    "1000000000000000000000000000000", "true", "false", '""', '"x"', "'nan'", "[]", "{}", "[[]]", "[0.0]", "[1,2,3]",
    "[1.0,true,2.0]", "[nan,0,0]", "[1,2,3,4,5,6]", "[[1,0,0],[0,1,0],[0,0,1]]", '[["a"]]', "1979-05-27", "07:32:00",
    "{a=1}", "{normal={std=1}}", "{normal={std=-1}}", "{uniform={low=1,high=0}}", "{lognormal={sigma=800.0}}",
    "{normal={}}", "{}", "{normal=3}", '"psi_s"', '"kl8(psi_x)"', '"tj4(rk4)"', '"gauss4"', '"float32"', '"float64"',
    '"sphere"', '"remus_100"',
]  # fmt: skip
NUMBER = re.compile(r"(?<![\w.\"])[+-]?(?:\d[\d_]*\.?\d*(?:[eE][+-]?\d+)?|nan|inf)(?![\w\"])")
TOKEN = re.compile(r"\"[^\"\n]*\"|[\w.+-]+|\s+|.", re.DOTALL)
WORDS = [
    "vehicle", "mass", "added_mass", "inertia", "buoyancy", "center_of_buoyancy", "environment", "gravity",
    "water_density", "start", "position", "rotation_vector", "quaternion_wxyz", "euler_deg", "attitude", "velocity",
    "velocity_inertial", "angular_velocity", "ensemble", "members", "seed", "vary", "run", "method", "step",
    "duration", "save_every", "dtype", "terms", "events", "type", "name", "rigid_body_mass_matrix",
    "added_mass_matrix", "weight", "center_of_gravity", "controller", "source", "drag", "tether", "current",
    "surface", "floor", "box", "depth", "lower", "upper", "[[", "]]", "[", "]", "{", "}", "=", ",", ".", '"', "'",
    "#", "\\n",
]  # fmt: skip


@functools.cache
def sources():
    """The texts that are broken: the examples, the vehicles, and one scene for each term, all terms and all events."""
    files = sorted([*(ROOT / "examples").glob("*.toml"), *(ROOT / "lgvi_warp" / "vehicles").glob("*.toml")])
    texts = [path.read_text(encoding="utf-8") for path in files]
    start = "[start]\nposition = [0.0, 0.0, 10.0]\neuler_deg = [1.0, 2.0, 3.0]\nvelocity = [0.5, 0.1, 0.0]\n"
    small = (
        "[vehicle]\nmass = 30.0\nadded_mass = [1.0, 30.0, 30.0]\ninertia = [0.2, 3.5, 3.5]\nbuoyancy = 296.0\n" + start
    )
    run = '[run]\nmethod = "psi_s"\nstep = 0.05\nduration = 0.5\nsave_every = 0.1\n'
    laws = []
    for page in sorted((ROOT / "docs" / "guide" / "terms").glob("*.md")):
        laws += [block for block in blocks(page, "toml") if "[[terms]]" in block]
    stops = "".join(
        f"[[events]]\n{text}\n"
        for text in ('type = "surface"', 'type = "floor"\ndepth = 50.0', 'type = "time"\nat = 3.0',
                     'type = "box"\nlower = [-9.0, -9.0, -9.0]\nupper = [9.0, 9.0, 90.0]')
    )  # fmt: skip
    named = '[vehicle]\nname = "remus_100"\n' + start + run + "[ensemble]\nmembers = 20\nseed = 3\n[ensemble.vary]\n"
    named += '"start.velocity" = { truncated_normal = { std = 0.1, width = 2.0 } }\n'
    named += '"drag.quadratic" = { lognormal = { sigma = 0.1 } }\n'
    matrices = "[vehicle]\n" + "".join(
        f"{name} = {np.diag(diagonal).tolist()}\n"
        for name, diagonal in (("rigid_body_mass_matrix", [30.0, 30.0, 30.0, 0.2, 3.5, 3.5]),
                               ("added_mass_matrix", [1.0, 30.0, 30.0, 0.0, 5.0, 5.0]))
    )  # fmt: skip
    texts += [small + run + law for law in laws] + [small + run + "\n".join(laws), small + run + stops]
    return [*texts, named, matrices + "weight = 299.0\nbuoyancy = 300.0\n" + start + run]


def toml(text):
    """A text whose lines end at "; " as well."""
    return text.replace("; ", "\n")


# A vehicle, its actuators, and its controller: all parts that a scene file may name stand in one of these.
CONTROLLED = [
    (
        toml("""
[vehicle]; name = "remus_100"; buoyancy = 299.0
[start]; velocity = [1.54, 0.0, 0.0]
[run]; step = 0.01; duration = 0.5
[ensemble]; members = 8
[ensemble.vary]; "vehicle.buoyancy" = { uniform = { low = 297.0, high = 302.0 } }
"""),
        toml("""
[controller]; period = 0.1; delay = 0.02
[[controller.sensors]]; type = "sensor"; name = "depth_cell"; of = "depth"; noise = 0.02; quantum = 0.005
[[controller.sensors]]; type = "sensor"; name = "compass"; of = "heading"; noise = 0.01; drift = 0.002; latency = 2
every = 3; dropout = 0.1
[[controller.guidance]]; type = "set_point"; depth = 10.0; heading = 0.5; speed = 1.5
[[controller.guidance]]; type = "reference_model"; natural_frequency = [0.2, 0.3, 0.2, 0.3]
damping_ratio = [1.0, 1.0, 1.0, 1.0]
[[controller.laws]]; type = "depth_pid"; kp = 0.1; ki = 0.001; pitch_limit = 0.5; kp_pitch = 5.0; ki_pitch = 0.3
kd_pitch = 2.0; integral_limit = [20.0, 20.0]
[[controller.laws]]; type = "heading_pid"; kp = 1.0; ki = 0.02; kd = 2.0; anti_windup = "none"
[[controller.allocation]]; type = "matrix"; to = "control_fins"; matrix = [[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]]
[[controller.faults]]; name = "stuck_rudder"; of = "control_fins"; channel = 0; time = 40.0; gain = 0.0; offset = 0.1
"""),
    ),
    (
        toml("""
[vehicle]; name = "bluerov2_heavy"
[run]; step = 0.01; duration = 0.5
"""),
        toml("""
[controller]; period = 0.05
[[controller.sensors]]; type = "sensor"; of = "velocity"; bias = [0.01, 0.0, 0.0]
[[controller.sensors]]; type = "dead_reckoning"
[[controller.guidance]]; type = "waypoints"; points = [[0.0, 0.0, 5.0], [10.0, 0.0, 5.0], [10.0, 10.0, 6.0]]
speed = 1.0; look_ahead = 3.0; radius = 1.0; times = [0.0, 12.0, 60.0]; loiter_radius = 2.0; loiter_turns = [0, 1.5, 0]
[[controller.guidance]]; type = "loiter"; center = [0.0, 0.0, 5.0]; radius = 4.0; speed = 0.5; look_ahead = 2.0
clockwise = false
[[controller.guidance]]; type = "docking"; position = [9.0, 0.0, 5.0]; heading = 0.5; speed = 1.0; contact_speed = 0.2
slowing = 5.0; look_ahead = 3.0; mouth = 0.5; funnel = 0.2; approach = 10.0; judged = 5.0; offset = 3.0
[[controller.guidance]]; type = "set_point"; position = [0.0, 0.0, 5.0]; heading = 0.0
[[controller.laws]]; type = "pose_pid"; kp = [40.0, 40.0, 60.0]; ki = [4.0, 4.0, 6.0]; kd = [60.0, 60.0, 80.0]
kr = [10.0, 10.0, 10.0]; kw = [4.0, 4.0, 4.0]; feedforward = "restoring"
[[controller.allocation]]; type = "pseudo_inverse"; to = "thrusters"; weights = [1, 1, 1, 1, 2, 2, 2, 2]
[[controller.faults]]; of = "thrusters"; channel = 4; time = 20.0; gain = 0.0; known = true
"""),
    ),
    (
        toml("""
[vehicle]; mass = 30.0; added_mass = [1.0, 30.0, 30.0]; inertia = [0.2, 3.5, 3.5]; buoyancy = 296.0
[[terms]]; type = "control_wrench"; limit = [25.0, 20.0, 15.0, 2.0, 2.5, 3.0]
[[events]]; type = "floor"; depth = [[40.0, 41.0], [42.0, 45.0]]; spacing = [50.0, 50.0]
[run]; step = 0.05; duration = 0.5
"""),
        toml("""
[controller]; period = 0.1
[[controller.sensors]]; type = "altimeter"; most = 60.0; noise = 0.05
[[controller.sensors]]; type = "imu"; gyroscope_noise = 5e-5
[[controller.sensors]]; type = "dvl"; noise = 0.01
[[controller.sensors]]; type = "error_state_filter"; dvl = "dvl"
[[controller.guidance]]; type = "altitude"; altitude = 5.0
[[controller.sensors]]; type = "low_pass"; of = "velocity"; time_constant = 0.5
[[controller.sensors]]; type = "complementary_filter"; time_constant = 5.0
[[controller.sensors]]; type = "sensor"; name = "gyroscope"; of = "angular_velocity"; noise = [0.001, 0.001, 0.002]
[[controller.guidance]]; type = "trajectory"; times = [0.5, 3.0, 8.0]; positions = [[0, 0, 3], [2, 1, 4], [5, -2, 6]]
headings = [0.3, 2.0, -2.5]; interpolation = "cubic"
[[controller.guidance]]; type = "set_point"; speed = 1.0
[[controller.laws]]; type = "heave_pid"; kp = 20.0
[[controller.laws]]; type = "linear_mpc"; states = ["velocity[2]"]; inputs = ["Z"]; A = [[0.9]]; B = [[0.003]]; Q = [1.0]
R = [0.01]; limit = [10.0]; rate_limit = [50.0]; horizon = 3
[[controller.laws]]; type = "speed_pid"; kp = 30.0; drag = 4.0
[[controller.laws]]; type = "heading_smc"; lambda = 0.4; boundary = 0.1; k_sigma = 0.2; k_d = 0.8; nomoto_gain = 0.25
nomoto_time = 1.5
[[controller.laws]]; type = "pose_smc"; lambda = [0.3, 0.4, 0.5]; boundary = [0.1, 0.2, 0.3]
lambda_r = [0.5, 0.6, 0.7]; boundary_r = [0.1, 0.2, 0.3]; k_sigma = [3.0, 4.0, 5.0]; k_d = [30.0, 40.0, 50.0]
k_sigma_r = [0.5, 0.6, 0.7]; k_d_r = [3.0, 4.0, 5.0]
[[controller.laws]]; type = "state_feedback"
K = [[1,0,0,0,0,0,1,0,0,0,0,0],[0,1,0,0,0,0,0,1,0,0,0,0],[0,0,1,0,0,0,0,0,1,0,0,0],[0,0,0,1,0,0,0,0,0,1,0,0],
     [0,0,0,0,1,0,0,0,0,0,1,0],[0,0,0,0,0,1,0,0,0,0,0,1]]
[[controller.allocation]]; type = "bounded_least_squares"; to = "control_wrench"; iterations = 2
[[controller.faults]]; of = "gyroscope"; channel = 1; offset = 0.1
"""),
    ),
]
CONTROLLED_WORDS = [
    "controller", "controller.laws", "sensors", "guidance", "laws", "allocation", "faults", "period", "delay", "type",
    "name", "to", "of", "sensor", "heading_pid", "pose_pid", "policy", "callback", "matrix", "pseudo_inverse", "fault",
    "waypoints", "trajectory", "set_point", "reference_model", "thrusters", "control_fins", "control_wrench", "gravity",
    "vehicle", "start", "position", "depth", "heading", "kp", "ki", "integral_limit", "weights", "channel", "time", "gain",
    "known", "file", "inputs", "every", "[[", "]]", "[", "]", "{", "}", "=", ",", ".", '"', "#",
]  # fmt: skip


def pick(rng, items):
    return items[int(rng.integers(len(items)))]


def mutated_bytes(rng, data, others):
    """Bytes flipped, cut, doubled, replaced by noise, or spliced with another file's."""
    data = bytearray(data)
    a, b = sorted(int(i) for i in rng.integers(0, len(data) + 1, 2))
    match int(rng.integers(6)):
        case 0:
            for i in rng.integers(0, len(data), int(rng.integers(1, 5))):
                data[int(i)] ^= 1 << int(rng.integers(8))
        case 1:
            del data[a : min(b, a + 40)]
        case 2:
            data[a:a] = data[a : min(b, a + 200)]
        case 3:
            data[a:a] = rng.bytes(int(rng.integers(1, 9)))
        case 4:
            del data[a:]
        case 5:
            other = pick(rng, others).encode()
            data[a:] = other[int(rng.integers(len(other))) :]
    return bytes(data)


def mutated_tokens(rng, text, words=WORDS):
    """Numbers, words and lines replaced, swapped, dropped or repeated: most of these are TOML still."""
    for _ in range(pick(rng, (1, 1, 1, 2, 3))):
        numbers, tokens = list(NUMBER.finditer(text)), TOKEN.findall(text)
        lines = text.split("\n")
        i, j = (int(k) for k in rng.integers(0, len(lines), 2))
        match int(rng.integers(8)):
            case 0 | 1 | 2 if numbers:
                one = pick(rng, numbers)
                text = text[: one.start()] + pick(rng, NUMBERS) + text[one.end() :]
            case 3 if "=" in lines[i]:
                lines[i] = lines[i].split("=")[0] + "= " + pick(rng, NUMBERS)
                text = "\n".join(lines)
            case 4 if tokens:
                tokens[int(rng.integers(len(tokens)))] = pick(rng, words)
                text = "".join(tokens)
            case 5:
                lines[i], lines[j] = lines[j], lines[i]
                text = "\n".join(lines)
            case 6:
                lines.insert(i, lines[j])
                text = "\n".join(lines)
            case 7:
                del lines[i]
                text = "\n".join(lines)
    return text


def case_of_file(seed):
    """The bytes of this case."""
    rng = np.random.default_rng([3, seed])
    texts = sources()
    text = pick(rng, texts)
    if rng.random() < 0.3:
        return mutated_bytes(rng, text.encode(), texts)
    return mutated_tokens(rng, text).encode("utf-8", "surrogateescape")


def case_of_controller(seed):
    """The bytes of this case: only the controller is broken."""
    rng = np.random.default_rng([7, seed])
    rest, section = pick(rng, CONTROLLED)
    if rng.random() < 0.2:
        return rest.encode() + mutated_bytes(rng, section.encode(), [section for _, section in CONTROLLED])
    return (rest + mutated_tokens(rng, section, CONTROLLED_WORDS)).encode("utf-8", "surrogateescape")


def case_of_set(seed):
    """Arguments of the command: a scene and some --set."""
    rng = np.random.default_rng([5, seed])
    scene = lw.Scene.load(ROOT / "examples" / "paper.toml")
    keys = [f"{name}.{key}" for name in ("vehicle", "start", "run", "ensemble", "environment") for key in WORDS]
    content = scene.to_dict()
    own = [f"{name}.{key}" for name in content for key in content[name]]
    keys += [*scene.parameters(), 'ensemble.vary."vehicle.mass"', "ensemble.vary.start.position", "terms.0", "",
             ".", "a.b.c", "vehicle.",
             "ensemble.vary", "ensemble.vary.", "source.x", "vehicle..mass", "vehicle.mass=3", "run.method"]  # fmt: skip
    arguments = ["run", str(ROOT / "examples" / "paper.toml")]
    for _ in range(pick(rng, (1, 1, 2, 3))):
        value = pick(rng, NUMBERS)
        if rng.random() < 0.2:
            value = mutated_bytes(rng, value.encode() or b"0", NUMBERS).decode("utf-8", "replace")
        equals = "" if rng.random() < 0.05 else "="
        key = pick(rng, keys if rng.random() < 0.3 else own)
        arguments.append(f"--set={key}{equals}{value}")
    return arguments


def named_key(fault, scene_text=""):
    """Whether a fault's text begins with something that is in the scene: a section, a term, an event or its name."""
    head = re.split(r"[.=\[:( ]", fault.strip("\"' "), maxsplit=1)[0]
    known = {*SECTIONS, *terms.TYPES, *events.TYPES, "law", "method", "attitude", "position", "save", "step", "h", "t1",
             "duration", "dtype", "velocity", "angular_velocity", "scene", "normal", "uniform",
             "--set", "vehicle file"}  # fmt: skip
    return head in known or head in scene_text or "is not TOML" in fault or "is not a dotted key" in fault


def judged(load, text):
    """(outcome, detail, scene): "accepted", "refused", or the fault of this package."""
    try:
        scene = load()
    except lw.SceneError as error:
        nameless = [fault for fault in error.faults if not named_key(fault, text) or not re.search(r"[.:;] ", fault)]
        if nameless or not error.faults:
            return "no key", "; ".join(nameless), None
        return "refused", "", None
    again = lw.Scene.from_dict(scene.to_dict()).to_dict()
    if json.dumps(again) != json.dumps(scene.to_dict()):
        return "not the same again", "", None
    return "accepted", "", scene


def planned(scene):
    """The plan of two steps of some of the members, or None where it is refused."""
    fleet = lw.Ensemble.from_scene(scene)
    h = scene.run.step or 0.01
    # As the user would run it, and for two steps: what takes long must be refused before it starts.
    with contextlib.suppress(lw.SceneError):
        make_plan(fleet)
    try:
        return make_plan(fleet, h=h, t1=2.0 * h)
    except lw.SceneError:
        return None


def run_two_steps(plan):
    """Fault of a run, or nothing: finite members where it says so."""
    result = run_plan(plan, 1)
    well = np.asarray(result.status) == 0
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        if not np.isfinite(getattr(result, name)[:, well]).all():
            return f"{name} is not finite, the status is OK"
    return ""


def judged_file(data):
    """Verdict on the bytes of a file."""
    with tempfile.NamedTemporaryFile(suffix=".toml") as file:
        Path(file.name).write_bytes(data)
        return judged(lambda: lw.Scene.load(file.name), data.decode("utf-8", "replace"))


def judged_set(seed):
    """Verdict on broken --set arguments."""
    chosen = cli.parser().parse_args(case_of_set(seed))
    return judged(lambda: lw.Scene.load(chosen.scene, cli.overrides(chosen)), " ".join(chosen.set))


JUDGES = {
    "files": lambda seed: judged_file(case_of_file(seed)),
    "controllers": lambda seed: judged_file(case_of_controller(seed)),
    "set": judged_set,
}


def work(kind, first, stop, most):
    """Judge these cases, a line of JSON for each."""
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    settings.MOST_MEMBERS = MOST_READ
    kernels = {make_plan(lw.Ensemble.from_scene(lw.Scene.load(ROOT / "examples" / "paper.toml"))).spec}
    if not most:
        # A plan holds the code of its kernel, half a second's work: here for scenes that are run.
        make = kernel_of_run.make_advance
        kernel_of_run.make_advance = lambda spec: make(spec) if spec in kernels else None
    for seed in range(first, stop):
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        print(json.dumps([seed, "begun", ""]), flush=True)
        try:
            outcome, detail, scene = JUDGES[kind](seed)
            plan = None if scene is None or lw.Ensemble.from_scene(scene).members > MOST_PLANNED else planned(scene)
            if (
                plan is not None
                and plan.ensemble.members <= MOST_RUN
                and (plan.spec in kernels or len(kernels) <= most)
            ):
                kernels.add(plan.spec)
                fault = run_two_steps(plan)
                outcome, detail = ("wrong result", fault) if fault else ("ran", "")
        except BaseException as error:  # every kind is what is looked for
            where = traceback.extract_tb(error.__traceback__)[-1]
            outcome, detail = type(error).__name__, f"{error} at {where.filename}:{where.lineno}"[-600:]
        print(json.dumps([seed, outcome, detail[:600]]), flush=True)
    faulthandler.cancel_dump_traceback_later()


def outcomes(kind, first, stop, most):
    """Seed -> (outcome, detail), judged in a process of its own; a hang or a crash is an outcome too, and the rest goes on."""
    found = {}
    while first < stop:
        command = [sys.executable, "-m", "tests.extremes.fuzz", kind, str(first), str(stop), str(most)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "kernels")])}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        for line in done.stdout.splitlines():
            seed, outcome, detail = json.loads(line)
            found[seed] = (outcome, detail)
        last = max(found, default=first)
        if done.returncode == 0 and last == stop - 1:
            break
        found[last] = ("hung or crashed", f"exit {done.returncode}: {done.stderr[-1500:]}")
        first = last + 1
    return found


GOOD = ("accepted", "refused", "ran")

if __name__ == "__main__":
    work(sys.argv[1], *(int(number) for number in sys.argv[2:]))
