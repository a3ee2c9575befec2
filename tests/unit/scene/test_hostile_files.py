# SPDX-License-Identifier: Apache-2.0
"""Scenes, tables and coefficients from a stranger: refused in a few lines, in bounded time and memory; nothing is written.

Each row of a table below is a file, or an argument, that somebody may meet. docs/guide/what_files_can_do.md says what holds.
"""

import io
import resource
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.cli import main
from lgvi_warp.cli.settings import out_of
from lgvi_warp.common import errors, reading
from lgvi_warp.scene.scene import from_dict
from tests.conftest import ROOT
from tests.support import hostile

BODY = "[vehicle]\nmass = 30.0\ninertia = [0.2, 3.0, 3.0]\nbuoyancy = 290.0\n"
START, VARY = BODY + "[start]\nposition = ", BODY + "[ensemble.vary]\n"
TABLED = BODY + "[ensemble.sampling.table]\nfile = 'table.csv'\n"
# Of this process's own time, however busy the machine is [s], and of its memory [kB].
MOST_SECONDS, MOST_KB = 2.0, 300_000


def refused(call, *arguments, words=(), **named):
    """The faults of a call that is refused: few, short, printable, and soon."""
    begun, before = time.thread_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(lw.SceneError) as caught:
        call(*arguments, **named)
    assert time.thread_time() - begun < MOST_SECONDS
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_KB
    lines = str(caught.value).splitlines()
    assert len(lines) <= errors.MOST_FAULTS + 2
    assert max(map(len, lines)) <= errors.HEAD + errors.END + 20
    assert all(line.isprintable() for line in lines)
    assert all(word in str(caught.value) for word in words), str(caught.value)[:2000]
    return caught.value


def tree(folder):
    """All that lies in a folder."""
    return sorted(str(path) for path in folder.rglob("*"))


def terms(count, kind="drag"):
    return BODY + f'[[terms]]\ntype = "{kind}"\n' * count


def numbered(line, count):
    return "".join(line.format(i) for i in range(count))


# Scenes: what the file holds, and words of the refusal.
SCENES = {
    "empty": (b"", ("vehicle", "is missing")),
    "spaces": (b" \n\t\n", ("vehicle", "is missing")),
    "text": (b"dear reader", ("is not TOML", "line 1")),
    "random bytes": (bytes(range(256)) * 9, ("UTF-8",)),
    "invalid UTF-8": (b"a = '\xc3\x28'", ("byte 0xc3 at 5", "Save it in UTF-8")),
    "UTF-16 with its mark": (BODY.encode("utf-16"), ("UTF-16", "Save it in UTF-8")),
    "UTF-16, large end first": (b"\xfe\xff" + BODY.encode("utf-16-be"), ("UTF-16",)),
    "UTF-32": (BODY.encode("utf-32"), ("UTF-16",)),
    "a zero byte": (BODY.encode() + b"a = \0\n", ("is not TOML",)),
    "old Macintosh lines": (BODY.replace("\n", "\r").encode(), ("is not TOML",)),
    "a pickle": (b"\x80\x04\x95\x15\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94", ("UTF-8",)),
    "NumPy's": (b"\x93NUMPY\x01\x00", ("UTF-8",)),
    "JSON": (b'{"vehicle": {"mass": 1}}', ("is not TOML",)),
    "lists in lists": ("a = " + "[" * 10_000 + "]" * 10_000, ("nested",)),
    "open lists": ("a = " + "[" * 100_000, ("nested",)),
    "tables in tables": ("a = " + "{a=" * 10_000 + "1" + "}" * 10_000, ("nested",)),
    "lists, less deep": (START + "[" * 30 + "]" * 30, ("nested more than 24 deep",)),
    "a key of a million points": ("a." * 500_000 + "a = 1", ("more than 8 parts",)),
    "quoted keys with points": ("'x y' . " * 100_000 + "a = 1", ("more than 8 parts",)),
    "a header of a million points": ("[" + "a." * 500_000 + "a]", ("more than 8 parts",)),
    "tables without end": (numbered("[a{}.b.c.d]\n", 60_000), ("60,000 tables",)),
    "terms without end": (terms(1500), ("terms are 1,500", "at most 1,000")),
    "events without end": ("events = [" + '{type="floor"},' * 40_000 + "]\n" + BODY, ("events are 40,000",)),
    "unknown terms": (terms(900, "drug"), ("900 faults", "and 880 more", "Did you mean 'drag'?")),
    "unknown keys": (BODY + numbered("key{} = 1\n", 30_000), ("30,000 faults", "and 29,980 more")),
    "unknown names that vary": (VARY + numbered("'a{}.b' = {{normal={{std=1.0}}}}\n", 6000), ("and 5,980 more",)),
    "unknown laws": (VARY + numbered("a{} = {{ norml = 1 }}\n", 6000), ("more",)),
    "a whole number of 5,000 digits": (BODY.replace("30.0", "9" * 5000), ("thousands of digits", "1.0e20")),
    "a whole number of 30 digits": (BODY.replace("30.0", "9" * 30), ("vehicle.mass", "64 bits")),
    "a hexadecimal of 100,000 digits": (BODY.replace("30.0", "0x" + "f" * 100_000), ("vehicle.mass", "120412 digits")),
    "a large seed": (BODY + "[ensemble]\nseed = 99999999999999999999\n", ("ensemble.seed", "64 bits")),
    "1e999": (BODY.replace("30.0", "1e999"), ("vehicle.mass = inf", "not finite")),
    "inf": (BODY.replace("290.0", "inf"), ("vehicle.buoyancy = inf", "not finite")),
    "nan": (BODY.replace("0.2,", "nan,"), ("vehicle.inertia", "not finite")),
    "a date": (BODY.replace("30.0", "2001-01-01"), ("vehicle.mass", "not numeric")),
    "a date that there is not": (BODY.replace("30.0", "2001-99-99"), ("is not TOML",)),
    "a truth value": (BODY.replace("30.0", "true"), ("vehicle.mass = True", "not numeric")),
    "a truth value among numbers": (BODY.replace("0.2,", "true,"), ("vehicle.inertia", "not numeric")),
    "a text for a number": (BODY.replace("30.0", "'30.0'"), ("vehicle.mass = '30.0'", "not numeric")),
    "a long text": (BODY.replace("30.0", "'" + "x" * 900_000 + "'"), ("vehicle.mass", "900,000 characters")),
    "a long name": (BODY + "'" + "x" * 900_000 + "' = 1", ("900,000 characters",)),
    "a text among 200,000 numbers": (START + f"['{'x' * 4000}', {'1,' * 200_000}]", ("start.position", "not numeric")),
    "200,000 numbers": (START + "[" + "1," * 200_000 + "]", ("start.position", "(200000,)")),
    "doubled keys": (BODY + "mass = 31.0\n", ("is not TOML", "line 5")),
    "doubled tables": (BODY + BODY, ("is not TOML",)),
    "codes for the terminal": (BODY + '"\\u001b]0;gone\\u0007\\n2 faults" = 1\n', (r"\x1b]0;gone\x07\n2 faults",)),
    "a section that is a number": ("vehicle = 3\n", ("vehicle = 3", "is not a table")),
    "a vehicle of another folder": ("[vehicle]\nname = '../../secret'\n", ("../../secret", "is not known")),
    "members without end": (BODY + "[ensemble]\nmembers = 9000000000000000000\n", ("members", "2147483648")),
    "a grid without end": (
        VARY + "'start.position' = {normal={std=1.0}}\n[ensemble.sampling.grid]\n'start.position' = 1000000000\n",
        ("more members than",)),
    "a hypercube without end": (
        BODY + "[ensemble]\nmembers = 2147483648\nsampling = {latin_hypercube = {group = 2147483648}}\n",
        ("group", "1048576")),
    "a law of scipy's that is none": (
        VARY + "'vehicle.mass' = {scipy = {name = '__import__'}}\n", ("__import__", "is not a distribution")),
    "a law of the user's": (VARY + "'vehicle.mass' = {own = {law = 'eval'}}\n", ("a file does not hold",)),
    "a table that is a device": (TABLED.replace("table.csv", "/dev/zero"), ("is a device",)),
}  # fmt: skip


def test_a_scene_with_windows_lines_and_a_mark_before_it_is_read(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + BODY.replace("\n", "\r\n").encode())
    assert lw.Scene.load(path).vehicle.mass == 30.0


# Tables of members.
WIDE = ",".join(f"column {i}" for i in range(16_000))
OBJECTS = hostile.npy(hostile.of_type("'|O'", (1,)))


def zipped(name, data):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, data)
    return buffer.getvalue()


TABLES = {
    "empty": (b"", ("is empty",)),
    "comments alone": (b"# a\n" * 1000, ("is empty",)),
    "16,000 unknown columns": ((WIDE + "\n" + "1," * 15_999 + "1\n").encode(), ("16,000 faults", "and 15,980 more")),
    "16,000 columns of one name": (b"vehicle.mass," * 15_999 + b"vehicle.mass\n", ("names a column twice",)),
    "numbers without names": (b"1,2\n3,4\n", ("numbers where the names should be",)),
    "names without numbers": (b"vehicle.mass\n", ("no members",)),
    "a line of two million characters": (b"a" * 2_000_000, ("line of more than 1.0 million",)),
    "a name of 200,000 characters": (b"a" * 200_000 + b"\n1\n", ("field larger than field limit",)),
    "a name of 100,000 commas": (b'"' + b"," * 100_000 + b'"\n1\n', ("does not name",)),
    "an open quote": (b'"vehicle.mass\n' + b"1\n" * 200_000, ("field larger",)),
    "a million lines that are wrong": (b"vehicle.mass\n" + b"x\n" * 500_000, ("9992 more such faults or more",)),
    "lines of different length": (b"vehicle.mass,vehicle.buoyancy\n30\n", ("2 names and 1 cells",)),
    "nan": (b"vehicle.mass\nnan\n", ("not finite", "line 2")),
    "1e999": (b"vehicle.mass\n1e999\n", ("not finite", "line 2")),
    "a date": (b"vehicle.mass\n2001-01-01\n", ("not a number",)),
    "a zero byte": (b"vehicle.mass\n3\x000\n", ("not a number",)),
    "UTF-16": ("vehicle.mass\n30\n".encode("utf-16"), ("UTF-8",)),
    "invalid UTF-8": (b"vehicle.mass\n\xc3\x28\n", ("UTF-8",)),
    "NumPy's array of objects": (OBJECTS, ("a file of NumPy",)),
    "NumPy's archive": (zipped("a.npy", OBJECTS), ("an archive",)),
    "an archive that means another folder": (zipped("../../escaped.csv", "vehicle.mass\n30\n"), ("an archive",)),
    "a compressed file": (b"\x1f\x8b\x08\x00", ("an archive",)),
    "codes for the terminal": (b"\x1b[2J\n1\n", (r"\x1b[2J",)),
}


FILES = {f"scene: {name}": row for name, row in SCENES.items()} | {
    f"table: {name}": row for name, row in TABLES.items()
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kind, (content, words) = name.partition(":")[0], FILES[name]
    Path("scene.toml").write_text(TABLED)
    data = content.encode() if isinstance(content, str) else content
    Path({"scene": "scene.toml", "table": "table.csv"}[kind]).write_bytes(data)
    before = tree(tmp_path)
    refused(lw.Scene.load, "scene.toml", words=words)
    assert tree(tmp_path) == before


# Files that are none. What opens them waits, or never ends.


DOORS = {"scene": lw.Scene.load, "table": lambda path: lw.designs.Table(str(path))}
# A harm to a path, or a whole path, and words of the refusal.
KINDS = {
    "folder": (hostile.folder, "is a folder"),
    "pipe": (hostile.pipe, "is a named pipe"),
    "socket": (hostile.bound, "is a socket"),
    "device": ("/dev/zero", "is a device"),
    "terminal": ("/dev/tty", "is a device"),
    "link to a device": (hostile.link("/dev/zero"), "is a device"),
    "link to itself": (hostile.to_itself, "symbolic links"),
    "huge": (hostile.sized(20_000_000_000), "20,000.0 MB"),
    "name with a zero byte": ("odd\0name", "null"),
    "long name": ("x" * 100_000, "File name too long"),
    "no name": ("", "No such file"),
    "missing": (Path("odd"), "No such file"),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_file_is_refused(kind, door, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_refused(DOORS[door], kind, tmp_path)


def check_refused(load, kind, tmp_path):
    """A reader refuses a file of this kind, with a remedy, and writes nothing."""
    made, words = KINDS[kind]
    if callable(made):
        made(tmp_path / "odd", tmp_path)
    before = tree(tmp_path)
    error = refused(load, tmp_path / "odd" if callable(made) else made, words=(words,))
    assert "Give" in str(error) or "Leave out" in str(error)
    assert tree(tmp_path) == before


def test_a_file_that_grows_while_it_is_read_ends(tmp_path, monkeypatch):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"#" * 1000)
    monkeypatch.setitem(reading.MOST_BYTES, "scene file", 500)
    monkeypatch.setattr(reading, "_refuse", lambda found, kind: None)
    refused(lw.Scene.load, path, words=("never ends",))


# Arguments of the command: exit code 2 and a line.
PAPER = str(ROOT / "examples" / "paper.toml")
# Verb and option, the key that is told, and of each value how it is told.
OPTIONS = [
    ("run --members", "ensemble.members",
     {"nan": "nan", "-1": "-1", "1e300": str(int(1e300))[:60], "1e999": "inf", "": "''", "2.5": "2.5", "true": "True"}),
    ("run --seed", "ensemble.seed", {"-1": "-1", "9" * 26: "9" * 26 + " is beyond"}),
    ("run --step", "run.step", {"nan": "nan", "-1": "-1", "0": "0", "": "''"}),
    ("check --step", "step", {"1e-300": "1e-300 needs"}),
    ("check --duration", "save.every", {"1e300": "1.0: asks for more"}),
    ("run --duration", "run.duration", {"inf": "inf"}),
    ("run --tolerance", "run.tolerance", {"nan": "nan"}),
    ("run --iterations", "run.iterations", {"1e9": "1000000000.0", "-1": "-1"}),
    ("run --keep", "run.keep", {"9" * 20: "9" * 20, "-1": "-1"}),
    ("run --members 8 --threads", "threads", {"-1": "-1", "1000000000": "1000000000 is more than 100,000"}),
    ("predict --threads", "threads", {"0": "0"}),
    ("run --members 8 --error", "error", {"nan": "nan", "inf": "inf", "-1": "-1"}),
    ("tradeoff --seconds", "seconds", {"nan": "nan", "inf": "inf", "-1": "-1", "0": "0"}),
    ("stability --points", "points", {"0": "(0, 0)", "1000000": "(1000000, 1000000) make"}),
    ("stability --error", "error", {"nan": "nan"}),
    ("sensitivity --of depth --samples", "samples", {"0": "0", "-4": "-4"}),
]  # fmt: skip
SET = {
    "vehicle.mass=120\n[start]": "vehicle.mass = '120\\n[start]' is not one value",
    "vehicle.mass=120\nvehicle.buoyancy=3": "is not one value",
    "run.method=psi_s\npsi": "is not one value",
    "vehicle.mass=" + "9" * 5000: "vehicle.mass",
    "vehicle.mass=" + "[" * 5000 + "]" * 5000: "nested",
    "=3": "is not a NAME=VALUE",
}
ARGUMENTS = (
    [([*option.split(), value, PAPER], f"{key} = {told}") for option, key, values in OPTIONS for value, told in values.items()]
    + [(["run", PAPER, "--set", value], words) for value, words in SET.items()]
    + [(["bench", "--members", "0"], "ensemble.members = 0")]
)  # fmt: skip


def short(arguments):
    return " ".join(word for word in arguments if word != PAPER)[:40]


@pytest.mark.parametrize(("arguments", "words"), ARGUMENTS, ids=[short(arguments) for arguments, _ in ARGUMENTS])
def test_an_argument_is_refused(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    begun = time.thread_time()
    assert main(arguments) == 2
    assert time.thread_time() - begun < 2.0 * MOST_SECONDS  # libraries are loaded
    text = capsys.readouterr().err
    assert words in text
    assert "Traceback" not in text
    assert len(text.splitlines()) <= 3


def test_a_list_over_many_lines_is_one_value(tmp_path):
    scene = lw.Scene.load(PAPER, {"start.position": "[1.0,\n 2.0,\n 3.0]\n", "vehicle.mass": "120 # kg"})
    assert (scene.start.position.tolist(), scene.vehicle.mass) == ([1.0, 2.0, 3.0], 120)


def test_a_scene_whose_name_means_another_folder_writes_below_runs():
    class Chosen:
        out, scene = None, "...toml"

    assert (str(out_of(Chosen())), str(out_of(Chosen(), "_x"))) == ("runs/scene", "runs/scene_x")


# Faults are counted.


def test_so_many_faults_are_said_and_the_rest_is_counted():
    faults = errors.Faults()
    asked = []
    for i in range(63):
        faults.add(f"key{i}", i, "is odd", lambda i=i: asked.append(i) or "correct it")
    error = refused(faults.raise_if_any)
    lines = str(error).splitlines()
    assert lines[0] == "63 faults:"
    assert lines[1] == "  key0 = 0 is odd. Correct it."
    assert lines[-1] == "  and 43 more"
    assert len(lines) == 22
    assert len(error.faults) == 20
    assert error.more == 43
    assert asked == list(range(20))  # what is not said costs nothing


def test_faults_within_faults_are_counted_once():
    inner = lw.SceneError(f"fault {i}" for i in range(50))
    assert (len(inner.faults), inner.more) == (20, 30)
    outer = errors.Faults()
    outer.add("first", 1, "is odd", "Correct it")
    for _ in range(2):
        with outer.including():
            raise inner.prefixed("here: ")
    error = refused(outer.raise_if_any)
    assert (len(error.faults), error.more) == (20, 81)
    assert error.faults[1] == "here: fault 0."
    again = error.__reduce__()
    assert str(again[0](*again[1])) == str(error)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("x" * 10**6, "'" + "x" * 76 + "..."),
        (list(range(10**6)), "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21..."),
        ({"b": 1, "a": (2.5, None)}, "{'b': 1, 'a': (2.5, None)}"),
        (np.arange(6.0).reshape(2, 3), "[[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]"),
        (np.float64(2.5), "2.5"),
        (10**5000, "<a whole number of about 5000 digits>"),
        (-(10**25), "-10000000000000000000000000"),
    ],
    ids=["text", "list", "table", "array", "number", "5,000 digits", "25 digits"],
)
def test_a_value_of_any_size_is_shown_on_a_line(value, text):
    assert errors.brief(value) == text


def test_lists_without_end_are_not_numeric():
    deep = []
    for _ in range(100_000):
        deep = [deep]
    for value in (deep, [10**400, 1.0], ["1", 2.0, 3.0], [1 + 2j], [None]):
        refused(from_dict, {"vehicle": {"mass": 1.0, "inertia": [1, 1, 1]}, "start": {"position": value}},
                words=("start.position", "not numeric"))  # fmt: skip
