# SPDX-License-Identifier: Apache-2.0
"""Published facts agree with pyproject.toml: addresses, versions, requirements; and it runs where nothing else is."""

import datetime
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import lgvi_warp as lw
from lgvi_warp.common import errors
from tests.conftest import ROOT
from tests.support.pages import snippets

CONFIGURATION = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = CONFIGURATION["project"]
SOURCE = PROJECT["urls"]["Source"]
RECIPE = (ROOT / ".ci" / "conda" / "recipe.yaml").read_text()
WORKFLOWS = {path.stem: path.read_text() for path in (ROOT / ".github" / "workflows").glob("*.yml")}
# Pages that say how to install it.
PAGES = ("README.md", "docs/start/install.md")
OTHER_PYTHONS = ("3.12", "3.13", "3.14")


def test_one_version():
    version = PROJECT["version"]
    assert lw.__version__ == version
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'version: "{version}"' in RECIPE
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()


def test_one_address():
    owner = re.fullmatch(r"https://github\.com/([\w-]+)/lgvi_warp", SOURCE)[1]
    names = (
        "pyproject.toml",
        ".ci/conda/recipe.yaml",
        "CITATION.cff",
        "CONTRIBUTING.md",
        "docs/develop/roadmap.md",
        *PAGES,
    )
    files = [ROOT / name for name in names]
    files += [path for path in (ROOT / ".github").rglob("*") if path.is_file()]
    assert set(re.findall(r"github\.com/([\w-]+)/lgvi_warp", "".join(map(Path.read_text, files)))) == {owner}
    assert all(address.startswith((SOURCE, f"https://{owner}.github.io/")) for address in PROJECT["urls"].values())


@pytest.mark.parametrize("page", PAGES)
def test_the_pages_install_it_from_where_it_is(page):
    text, published = (ROOT / page).read_text(), CONFIGURATION["tool"]["lgvi_warp"]["published"]
    if published:
        assert "pip install 'lgvi-warp" in text
    else:
        assert f"git clone {SOURCE}" in text
        assert re.search(r"pip install (-e )?'\.\[viz\]'", text)
        assert not re.search(r"(pip install|uvx) '?lgvi-warp", text)


def test_messages_and_pages_install_extras_from_where_they_are():
    assert CONFIGURATION["tool"]["lgvi_warp"]["published"] == errors.PUBLISHED
    home = Path(errors.__file__)
    files = [path for folder in ("docs", "lgvi_warp", "examples") for path in (ROOT / folder).rglob("*")]
    texts = {path: path.read_text() for path in files if path.suffix in (".md", ".py", ".ipynb") and path != home}
    assert [path for path, text in texts.items() if re.search(r"pip install '?lgvi-warp", text)] == []


def test_the_recipe_asks_for_what_the_package_asks_for():
    def requirements(section):
        lines = re.search(rf"\n  {section}:\n((?:    - .*\n)+)", RECIPE)[1]
        return set(re.findall(r"- (.*)", lines))

    def spaced(texts):
        return {re.sub(r"([><=])", r" \1", text, count=1) for text in texts}

    python = {f"python {PROJECT['requires-python']}"}
    assert requirements("run") == spaced(PROJECT["dependencies"]) | python
    assert requirements("host") == spaced(CONFIGURATION["build-system"]["requires"]) | python | {"pip"}
    assert f"license: {PROJECT['license']}\n" in RECIPE
    assert f'summary: "{PROJECT["description"]}"\n' in RECIPE
    for name, place in PROJECT["scripts"].items():
        assert f"- {name} = {place}\n" in RECIPE


def test_the_workflow_has_each_python_that_is_promised():
    promised = {line.rsplit(" ", 1)[1] for line in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", line)}
    assert promised == {"3.11", *OTHER_PYTHONS}
    assert promised <= set(re.findall(r'"(3\.\d+)"', WORKFLOWS["ci"]))
    assert "id-token: write" in WORKFLOWS["release"]
    assert "password" not in WORKFLOWS["release"]


def test_the_dockerfile_is_short_and_has_a_promised_python():
    text = (ROOT / ".ci" / "Dockerfile").read_text()
    assert len(text.splitlines()) <= 10
    assert re.match(r"#.*\nFROM python:(.*)-slim\n", text)[1] in OTHER_PYTHONS
    ignored = (ROOT / ".ci" / "Dockerfile.dockerignore").read_text().split()
    assert {".git", ".venv*", "runs", "build", "dist"} <= set(ignored)


def test_the_citation_has_the_day_of_a_release():
    day = re.search(r'^date-released: "(.*)"$', (ROOT / "CITATION.cff").read_text(), re.MULTILINE)[1]
    assert datetime.date.fromisoformat(day)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built without network."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], check=True, cwd=ROOT)
    (path,) = folder.glob("*.whl")
    return path


@pytest.mark.slow
def test_links_of_the_long_description_lead_out_of_the_wheel(wheel):
    with zipfile.ZipFile(wheel) as content:
        (name,) = (name for name in content.namelist() if name.endswith(".dist-info/METADATA"))
        description = content.read(name).decode().partition("\n\n")[2]
    links = re.findall(r"\]\(([^)]+)\)", description)
    assert len(links) > 20
    assert all(link.startswith("https://") for link in links)
    for link in links:
        inside = re.match(rf"{SOURCE}/(?:raw|blob)/v{PROJECT['version']}/(.*)", link)
        assert inside is None or (ROOT / inside[1]).exists()
    assert all(f"{SOURCE}/raw/" in link for link in links if link.endswith((".png", ".webp")))


def clean():
    """This process's variables without those of a Python."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}


def run_readme(python, folder):
    """README's lines, in an empty folder, by a Python that has the wheel alone."""
    _, code, output = snippets("README.md", "python")[0]
    (folder / "typed.py").write_text(f"import matplotlib\nmatplotlib.use('Agg')\n{code}")
    done = subprocess.run([python, "typed.py"], cwd=folder, env=clean(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == output
    assert (folder / "where_to_search.png").stat().st_size > 1000


def python_of(version):
    """A Python of a version, of those that this machine has; skips the test where there is none."""
    for found in (
        shutil.which(f"python{version}"),
        *sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python")),
    ):
        if found and subprocess.run([found, "-c", "import venv"], capture_output=True, check=False).returncode == 0:
            return str(found)
    pytest.skip(f"no Python {version} on this machine")


@pytest.mark.slow
@pytest.mark.parametrize("version", ["3.11", *OTHER_PYTHONS])
def test_the_wheel_in_an_empty_environment(version, wheel, tmp_path):
    python = sys.executable if version == "{}.{}".format(*sys.version_info) else python_of(version)
    subprocess.run([python, "-m", "venv", tmp_path / "environment"], check=True, env=clean())
    inside = tmp_path / "environment" / "bin"
    install = [inside / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{wheel}[viz]"]
    subprocess.run(install, check=True, env=clean())
    run_readme(inside / "python", tmp_path)
    told = subprocess.run([inside / "lgvi-warp", "--version"], check=True, env=clean(), capture_output=True, text=True)
    assert PROJECT["version"] in told.stdout


@pytest.mark.slow
def test_uv_installs_and_runs_it(wheel, tmp_path):
    uv = shutil.which("uv", path=os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]]))
    if uv is None:
        pytest.skip("uv is not installed")
    settings = clean() | {"UV_PYTHON": sys.executable, "UV_PYTHON_DOWNLOADS": "never"}
    told = subprocess.run([uv, "tool", "run", "--from", str(wheel), "lgvi-warp", "--version"], cwd=tmp_path, env=settings,
                          check=True, capture_output=True, text=True)  # fmt: skip
    assert PROJECT["version"] in told.stdout
    subprocess.run([uv, "venv", "environment"], check=True, cwd=tmp_path, env=settings)
    install = [uv, "pip", "install", "--python", tmp_path / "environment", str(wheel)]
    subprocess.run(install, check=True, cwd=tmp_path, env=settings)
    inside = tmp_path / "environment" / "bin"
    subprocess.run([inside / "lgvi-warp", "new", "scene.toml"], check=True, cwd=tmp_path, env=clean())


@pytest.mark.slow
def test_the_container_runs():
    docker = shutil.which("docker")
    if docker is None or subprocess.run([docker, "info"], capture_output=True, check=False, timeout=60).returncode:
        pytest.skip("no docker that answers on this machine")
    build = [docker, "build", "--file", ".ci/Dockerfile", "--tag", "lgvi_warp_test", "."]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode and re.search("resolve|pull|network|registry", done.stderr):
        pytest.skip(f"the image of Python cannot be had: {done.stderr[-300:]}")
    assert done.returncode == 0, done.stderr
    told = subprocess.run(
        [docker, "run", "--rm", "lgvi_warp_test", "--version"], check=True, capture_output=True, text=True
    )
    assert PROJECT["version"] in told.stdout
