"""A recording is there whole or not at all."""

import pytest
import rerun as rr

import lgvi_warp as lw
from tests.support.tools import one, scene_of

pytestmark = pytest.mark.kernel


@pytest.fixture
def result():
    """Two samples of one member."""
    return lw.solve(one(scene_of((2.0, 2.0, 2.0))), h=0.1, t1=0.1)


def test_whole(tmp_path, result):
    assert lw.log_rerun(result, tmp_path / "fleet.rrd") == tmp_path / "fleet.rrd"
    assert [path.name for path in tmp_path.iterdir()] == ["fleet.rrd"]


def test_a_disk_that_is_full(tmp_path, result, monkeypatch):
    # rerun says so by a RuntimeError when its writer has stopped. What was there before stays.
    old = tmp_path / "fleet.rrd"
    old.write_bytes(b"before")

    def flush(self):
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr(rr.RecordingStream, "flush", flush)
    with pytest.raises(OSError, match="is the disk full"):
        lw.log_rerun(result, old)
    assert [path.name for path in tmp_path.iterdir()] == ["fleet.rrd"] and old.read_bytes() == b"before"
