# SPDX-License-Identifier: Apache-2.0
"""The wheel and the source archive are the same bytes in each build, and hold what they should.

`python -m tests.house.test_dist FOLDER` lists the faults of the archives in a folder; `make dist` calls it.
"""

import hashlib
import io
import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.conftest import ROOT

# Folders of the machine that builds: neither the clone's nor those below a user's home belong into an archive.
PLACES = re.compile("|".join((re.escape(str(ROOT)), re.escape(sys.prefix), r"/(?:home|Users)/\w+/")).encode())
# What pip needs to build from the source archive, and what a packager needs to test.
IN_THE_SOURCE = {"pyproject.toml", "README.md", "LICENSE", "lgvi_warp/__init__.py", "tests/conftest.py", "PKG-INFO"}
OURS = ("lgvi_warp/", "lgvi_kernels/", "lgvi_warp-")


def contents(path):
    """{name: bytes} of an archive's files; names in the source archive without its top folder."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    with tarfile.open(path) as archive:
        files = [member for member in archive.getmembers() if member.isfile()]
        return {member.name.partition("/")[2]: archive.extractfile(member).read() for member in files}


def faults(folder):
    """Sentences on what is wrong with the archives in a folder."""
    wheels, sources = sorted(Path(folder).glob("*.whl")), sorted(Path(folder).glob("*.tar.gz"))
    if (len(wheels), len(sources)) != (1, 1):
        yield f"{folder} needs one wheel and one source archive, not {len(wheels)} and {len(sources)}."
        return
    wheel, source = contents(wheels[0]), contents(sources[0])
    yield from (f"{name} does not belong into the wheel." for name in wheel if not name.startswith(OURS))
    yield from (f"{name} is missing in the source archive." for name in sorted(IN_THE_SOURCE - set(source)))
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    extra = set(source) - set(tracked) - {"PKG-INFO"}
    yield from (f"{name} is in the source archive, but not in git." for name in sorted(extra))
    for archive in (wheel, source):
        for name, text in archive.items():
            if found := PLACES.search(text):
                yield f"{name} names a folder of this machine, {found[0].decode()}."


def build(folder, root=ROOT, *targets):
    """Build into a folder at the time of the last commit, without network. Returns {name: hash}."""
    epoch = subprocess.run(["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True, check=True)
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", folder, *targets], check=True, cwd=root,
                   capture_output=True, env=os.environ | {"SOURCE_DATE_EPOCH": epoch.stdout.strip()})  # fmt: skip
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in Path(folder).iterdir()}


def archives_of(folder, wheel, source):
    """Archives with these files."""
    with zipfile.ZipFile(folder / "a-1.whl", "w") as archive:
        for name, text in wheel.items():
            archive.writestr(name, text)
    with tarfile.open(folder / "a-1.tar.gz", "w:gz") as archive:
        for name, text in source.items():
            member = tarfile.TarInfo(f"a-1/{name}")
            member.size = len(text)
            archive.addfile(member, io.BytesIO(text.encode()))


def test_what_does_not_belong_is_listed(tmp_path):
    complete = dict.fromkeys(IN_THE_SOURCE, "text")
    archives_of(tmp_path, {"lgvi_warp/__init__.py": ""}, complete)
    assert list(faults(tmp_path)) == []
    home = "/".join(("", "home", "someone", ""))
    complete.pop("LICENSE")
    archives_of(tmp_path, {"tests/conftest.py": "", "lgvi_warp/a.py": home + "clone"}, complete | {"note.txt": ""})
    assert list(faults(tmp_path)) == [
        "tests/conftest.py does not belong into the wheel.",
        "LICENSE is missing in the source archive.",
        "note.txt is in the source archive, but not in git.",
        f"lgvi_warp/a.py names a folder of this machine, {home}.",
    ]
    (tmp_path / "a-2.whl").touch()
    assert list(faults(tmp_path)) == [f"{tmp_path} needs one wheel and one source archive, not 2 and 1."]


def test_releases_are_built_at_the_time_of_the_commit():
    for name in ("Makefile", ".github/workflows/release.yml"):
        assert re.search(r'SOURCE_DATE_EPOCH="\$+\(git log -1 --format=%ct\)"', (ROOT / name).read_text()), name


@pytest.mark.slow
def test_two_builds_and_one_of_the_source_archive_are_the_same_bytes(tmp_path):
    first = build(tmp_path / "first")
    assert len(first) == 2
    assert build(tmp_path / "second") == first
    assert list(faults(tmp_path / "first")) == []
    (source,) = (tmp_path / "first").glob("*.tar.gz")
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    wheel = build(tmp_path / "third", unpacked, "-t", "wheel")
    assert wheel.items() <= first.items()


if __name__ == "__main__":
    found = list(faults(sys.argv[1]))
    print("\n".join(found) or "The archives hold what they should.")
    sys.exit(bool(found))
