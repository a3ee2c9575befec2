# SPDX-License-Identifier: Apache-2.0
"""The wheel is complete: it is installed into an empty environment and runs there."""

import os
import re
import shlex
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.support.pages import snippets

sys.path.append(str(ROOT / "docs"))

from site_parts import tutorial

pytestmark = pytest.mark.slow
# What differs from machine to machine, and from run to run.
OF_MACHINE = re.compile(r"^(?:speed|kernel) .*\n|\(\d+\.\d MB\)", re.MULTILINE)


# What the wheel holds of the folder `examples`, and commands of pages that follow "In a clone:".
EXAMPLES = re.compile(r"examples/(paper\.toml|(scenes|sweeps|validation)/.*)$")
IN_A_CLONE = re.compile(r"[Ii]n a clone[:,].*?(?=\)|\n\n)", re.DOTALL)


def commands_of(page):
    """Commands of the package in the text of a page, but for those that need a clone."""
    text = IN_A_CLONE.sub("", (ROOT / page).read_text())
    commands = re.findall(r"`((?:lgvi-warp|python|make) [^`\n]+)`", text)
    return list(dict.fromkeys([*commands, *re.findall(r"^    (lgvi-warp .*?)(?: +#.*)?$", text, re.MULTILINE)]))


def as_shown(printed, shown):
    """Whether a page shows, indented, what was printed; ... stands for any lines."""
    lines = re.escape(OF_MACHINE.sub("", re.sub("^    ", "", shown, flags=re.MULTILINE)))
    return re.fullmatch(lines.replace(r"\.\.\.", r"[\s\S]*"), OF_MACHINE.sub("", printed)) is not None


def test_what_differs_is_seen():
    shown = "    file a (0.1 MB)\n    ...\n    speed  1\n    end 3\n"
    assert as_shown("file a (2.0 MB)\nmore\nspeed  2\nend 3\n", shown)
    assert not as_shown("file a (2.0 MB)\nmore\nspeed  2\nend 4\n", shown)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of the wheel and the source archive, built without network."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", str(folder)], check=True, cwd=ROOT)
    return folder


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """Run a command of an environment that holds the wheel, and sees this environment's other packages, in an empty folder."""
    environment, folder = tmp_path_factory.mktemp("environment"), tmp_path_factory.mktemp("empty")
    variables = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    scripts = environment / ("Scripts" if os.name == "nt" else "bin")
    (wheel,) = built.glob("*.whl")

    def run(command, *arguments):
        command = [scripts / command, *map(str, arguments)]
        return subprocess.run(command, check=True, cwd=folder, env=variables, capture_output=True, text=True).stdout

    subprocess.run([sys.executable, "-m", "venv", environment], check=True)
    run("python", "-m", "pip", "install", "--no-index", "--no-deps", wheel)
    packages = Path(run("python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    # A path in a .pth file is searched, but the .pth files in that folder are not read: no editable install is seen.
    others = [place for place in sys.path if Path(place).name in ("site-packages", "dist-packages")]
    (packages / "others.pth").write_text("\n".join(others))
    return run


def test_the_wheel_holds_the_packages_and_their_data(built):
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    tracked = subprocess.run(["git", "ls-files"], check=True, cwd=ROOT, capture_output=True, text=True).stdout.split()
    packages = {"lgvi_warp", "lgvi_kernels"}
    expected = {name.removeprefix("kernels/") for name in tracked}
    expected = {name for name in expected if name.partition("/")[0] in packages}
    expected |= {f"lgvi_warp/{name}" for name in tracked if EXAMPLES.match(name)}
    assert {name for name in names if ".dist-info/" not in name} == expected
    assert {"lgvi_warp/py.typed", "lgvi_warp/__init__.pyi", "lgvi_warp/vehicles/remus_100.toml"} <= names


def test_the_source_archive_holds_what_the_tests_need(built):
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as content:
        names = {name.partition("/")[2] for name in content.getnames()}
    assert {"pyproject.toml", "LICENSE", "README.md", "tests/conftest.py", "examples/paper.toml"} <= names


def test_the_package_is_imported_from_the_environment(installed):
    place = installed(
        "python", "-c", "import lgvi_warp, lgvi_kernels; print(lgvi_warp.__file__, lgvi_kernels.__file__)"
    )
    assert str(ROOT) not in place
    assert place.count("environment") == 2


def test_the_command_helps(installed):
    assert "lgvi-warp" in installed("lgvi-warp", "--help")


def test_an_example_runs(installed):
    installed("lgvi-warp", "run", "example:paper", "--members", "8", "--duration", "2", "--out", "paper")
    listed = installed("python", "-c", "import os; print(*sorted(os.listdir('paper')))").split()
    assert {"result.npz", "fleet.png"} <= set(listed)


def test_examples_are_those_of_the_clone(installed):
    listed = installed("lgvi-warp", "example").splitlines()
    files = {
        path.stem: path for path in ROOT.glob("examples/**/*.toml") if EXAMPLES.match(path.relative_to(ROOT).as_posix())
    }
    assert {line.partition(" ")[0] for line in listed} == set(files)
    assert installed("lgvi-warp", "example", "three_laws") == files["three_laws"].read_text()
    code = "import lgvi_warp as lw; print(lw.Scene.load('example:slocum_comet').source['file'])"
    assert installed("python", "-c", code) == "slocum_comet.toml\n"
    assert "can run" in installed("lgvi-warp", "check", "example:slocum_comet")


def test_readme_and_the_first_page_need_no_clone(installed):
    """Every command and snippet ends with exit code 0 in an empty folder."""
    commands = list(dict.fromkeys([*commands_of("README.md"), *commands_of("docs/index.md")]))
    assert len(commands) >= 4
    assert {command.partition(" ")[0] for command in commands} == {"lgvi-warp"}
    for command in commands:
        installed(*shlex.split(command))
    codes = [snippet.code for snippet in snippets("README.md", "python")]
    assert len(codes) == 1
    assert (ROOT / "examples" / "where_to_search.py").read_text().endswith(codes[0])
    for code in codes:
        installed("python", "-c", code)


def test_the_tutorial_prints_what_it_shows(installed):
    folder = Path(installed("python", "-c", "import os; print(os.getcwd())").strip())
    scene, code, expected, commands = "", "", "", 0
    for lines, snippet, output, command, shown in tutorial.STEP.findall(tutorial.PAGE.read_text()):
        scene, code, expected = scene + lines + "\n", code + snippet, expected + output
        (folder / "dive.toml").write_text(scene)
        if command:
            assert as_shown(installed(*command.split()), shown), command
            commands += 1
    assert as_shown(installed("python", "-c", code), expected)
    assert commands == 5
    assert code.count("import") == 1
    assert all((folder / picture).exists() for picture in tutorial.WRITTEN)
