# SPDX-License-Identifier: Apache-2.0
"""The verb view: a run that is there, in the viewer or as a recording."""

import subprocess
import sys

import pytest

from lgvi_warp.cli import main
from tests.unit.views.test_recording import fleet, text_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    fleet(6, 9).save(folder / "result.npz")
    return folder


@pytest.mark.parametrize("name", ["", "result.npz"])
def test_a_recording_of_some_members(folder, tmp_path, capsys, name):
    path = tmp_path / "few.rrd"
    assert main(["view", str(folder / name), "--members", "3, 5", "--out", str(path)]) == 0
    assert "2 of 6 drawn" in text_of(path, "/run/summary")
    assert str(path) in capsys.readouterr().out


@pytest.mark.parametrize(("arguments", "words"), [
    (["--members", "6"], "members = 6 is none of the 6 members. Give indices from 0 to 5"),
    (["--members", "a"], "--members a is not a list of members. Write --members 3,17"),
    (["--members", ""], "is not a list of members"),
])  # fmt: skip
def test_bad_members_are_refused(folder, tmp_path, capsys, arguments, words):
    assert main(["view", str(folder), "--out", str(tmp_path / "a.rrd"), *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "words", "code"),
    [("none", "is not there. Give the folder of a run or", 2), ("none.npz", "No such file", 1), ("study", "no run", 2)],
)
def test_a_folder_without_a_run_is_refused(tmp_path, capsys, name, words, code):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "sweep.json").write_text("{}")
    assert main(["view", str(tmp_path / name)]) == code
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="files have no limit of size there")
def test_a_disk_that_is_full_while_recording_is_one_line_and_leaves_no_file(tmp_path):
    import resource

    fleet(200, 200).save(tmp_path / "result.npz")
    code = "from lgvi_warp.cli import entry; import sys; sys.argv = ['lgvi-warp', *sys.argv[1:]]; entry()"
    arguments = [sys.executable, "-c", code, "view", str(tmp_path), "--out", str(tmp_path / "a.rrd"), "-q"]
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))  # noqa: E731
    done = subprocess.run(arguments, capture_output=True, text=True, preexec_fn=limit)
    assert done.returncode == 1
    assert f"{tmp_path / 'a.rrd'}: File too large" in done.stderr
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["result.npz"]


def test_no_rerun_is_one_line_with_the_remedy(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["view", str(folder), "--out", str(tmp_path / "a.rrd")]) == 2
    assert "pip install '.[viz]'" in capsys.readouterr().err
