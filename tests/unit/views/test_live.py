# SPDX-License-Identifier: Apache-2.0
"""A run in the viewer while it goes on: members come block by block; a viewer that is none is named with the remedy."""

import contextlib
import dataclasses
import socket
import threading

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common.status import under_way
from lgvi_warp.views.recording import viewer
from lgvi_warp.views.recording.live import Live
from tests.conftest import ROOT
from tests.support.made import made
from tests.support.viewer import free_port, receiver, serving, started_by
from tests.unit.views.test_recording import fleet, rows, text_of


def blocks(result, *sizes):
    """The results of successive members, as a run hands them over while it goes on."""
    stop = 0
    for size in sizes:
        places = np.arange(stop, stop + size)
        provenance = result.provenance | {"members": result.members}
        yield dataclasses.replace(result.part(places), provenance=provenance)
        stop += size


def recorded(path, several):
    """The recording of a run that goes on, of blocks that are finished one after another."""
    recording = rr.RecordingStream("live", recording_id="live")
    recording.save(path)
    live = Live(recording)
    for block in several:
        live.add(block)
    recording.disconnect()
    return path


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    """A fleet, and the recording of it that grew by blocks of 30, 30 and 20 members."""
    result = fleet(80)
    return result, recorded(tmp_path_factory.mktemp("live") / "live.rrd", blocks(result, 30, 30, 20))


def test_every_member_is_drawn_once_in_its_outcomes_colour(grown):
    result, path = grown
    last_frame = {}
    for first, stop in ((0, 30), (30, 60), (60, 80)):
        for code in ("ok", "non_finite", "surface", "floor"):
            poses = rows(path, f"/world/from_{first}/bodies/{code}", "translations")
            scales = rows(path, f"/world/from_{first}/bodies/{code}", "scales")
            if poses:
                t = max(poses)
                visible = [scale[0] == 1.0 for scale in scales[t]] if scales else [True] * len(poses[t])
                last_frame.setdefault(first, []).extend(pose for pose, on in zip(poses[t], visible, strict=True) if on)
        expected = result.position[-1, first:stop].astype(np.float32)
        drawn = np.array(sorted(last_frame[first]), np.float32)
        np.testing.assert_array_equal(drawn, expected[np.lexsort(expected.T[::-1])])


def test_the_text_has_the_counts_so_far(grown):
    result, path = grown
    text = text_of(path, "/run/summary")
    assert "30 of 80 members done: " in text
    assert "60 of 80 members done: " in text
    assert text.index("30 of 80") < text.index("60 of 80") < text.index("'80 members done: ")
    for name, number in result.status.counts().items():
        assert f"{name} {number}" in text[text.index("'80 members done: ") :]


def test_curves_are_of_single_members_while_under_way(grown):
    result, path = grown
    names = {chunk.entity_path for chunk in RrdReader(path).stream().filter(content="/curves/height/**")}
    members = sorted(int(name.rsplit("/", 1)[1]) for name in names)
    assert len(members) == 40
    assert members[0] < 30 < members[-1]
    counted = under_way(result)
    assert not counted[:, members].all()
    for member in members:
        curve = rows(path, f"/curves/height/{member}", "scalars")
        times, heights = result.time[counted[:, member]], -result.position[counted[:, member], member, 2]
        seen = {time: height for time, (height,) in curve.items() if np.isfinite(height)}
        assert seen == pytest.approx(dict(zip(times.tolist(), heights, strict=True)), rel=1e-6)


def test_the_view_is_laid_out_anew_when_it_is_outgrown(tmp_path):
    result = fleet(40)
    near, far = blocks(result, 20, 20)
    for offset, layouts in ((0.0, 1), (500.0, 2)):
        position = far.position + np.array([offset, 0.0, 0.0])
        moved = dataclasses.replace(far, samples={**far.samples, "position": position})
        path = recorded(tmp_path / f"{offset:g}.rrd", (near, moved))
        assert len(RrdReader(path).blueprints()) == layouts


def test_blocks_share_the_places_of_a_large_run(tmp_path):
    """A thousand of 2,400 members are drawn: 500 of each half."""
    path = recorded(tmp_path / "live.rrd", blocks(made(np.zeros((2, 2400, 3)) + 5.0), 1200, 1200))
    for first in (0, 1200):
        assert len(rows(path, f"/world/from_{first}/bodies/ok", "translations")[0.0]) == 500


def test_members_without_paths_are_counted(tmp_path):
    path = recorded(tmp_path / "live.rrd", [dataclasses.replace(fleet(8), samples={})])
    assert "8 members done" in text_of(path, "/run/summary")


def test_a_viewer_gets_what_the_file_gets(tmp_path):
    with receiver(tmp_path / "sent.rrd") as address:
        lw.record(fleet(20), tmp_path / "written.rrd", to=address)
    sent, written = (rows(tmp_path / name, "/world/bodies/ok", "translations") for name in ("sent.rrd", "written.rrd"))
    assert sent == written
    assert len(sent) == 31


def test_a_viewer_that_is_closed_ends_the_view_and_not_the_run(tmp_path):
    port = free_port()
    command = [str(viewer.program()), "--bind", "127.0.0.1", "--port", str(port), "--save", str(tmp_path / "sent.rrd")]
    first, second, third = blocks(fleet(30), 10, 10, 10)
    with serving(command, port) as process:
        recording = rr.RecordingStream("live", recording_id="live")
        recording.connect_grpc(f"rerun+http://127.0.0.1:{port}/proxy")
        live = Live(recording)
        live.add(first)
        process.kill()
        process.wait()
    live.add(second)
    assert live.closed
    live.add(third)


@pytest.mark.kernel
def test_run_shows_members_as_they_are_done_then_the_whole_run(tmp_path, capsys):
    command = ["run", str(ROOT / "examples" / "paper.toml"), "--out", str(tmp_path), "--members", "20", "--duration",
               "2"]  # fmt: skip
    with receiver(tmp_path / "sent.rrd") as address:
        assert cli.main([*command, "--set", "run.save_every=0.5", "--live", "--viewer", address]) == 0
    assert "fleet.rrd" in capsys.readouterr().out
    assert (tmp_path / "fleet.rrd").exists()
    entries = {entry.recording_id[:5]: entry for entry in RrdReader(tmp_path / "sent.rrd").recordings()}
    (whole,) = (entry for start, entry in entries.items() if start != "live_")
    poses = rows(tmp_path / "sent.rrd", "/world/from_0/bodies/ok", "translations", entries["live_"])
    assert "20 members done: ok 20" in text_of(tmp_path / "sent.rrd", "/run/summary", entries["live_"])
    assert "| outcome | ok 20 |" in text_of(tmp_path / "sent.rrd", "/run/summary", whole)
    assert sorted(poses) == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert all(len(frame) == 20 for frame in poses.values())


@contextlib.contextmanager
def peer(words):
    """The port of something that listens, says these words to all, and hears them out."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()

        def hear(connection):
            with connection, contextlib.suppress(OSError):
                connection.sendall(words)
                while connection.recv(2**16):
                    pass

        def greet():
            with contextlib.suppress(OSError):
                while True:
                    threading.Thread(target=hear, args=(listener.accept()[0],), daemon=True).start()

        threading.Thread(target=greet, daemon=True).start()
        yield listener.getsockname()[1]
        with contextlib.suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)


def test_what_is_no_viewer_ends_the_sending_and_leaves_the_file(tmp_path):
    path = tmp_path / "fleet.rrd"
    with (
        peer(b"HTTP/1.1 400 Bad Request\r\n\r\n") as port,
        pytest.raises(OSError, match=r"the recording could not be sent .*. Start the viewer again"),
    ):
        lw.record(fleet(20), path, to=f"rerun+http://127.0.0.1:{port}/proxy")
    assert len(rows(path, "/world/bodies/ok", "translations")) == 31


def test_a_sending_ends_where_the_viewer_is_gone_or_takes_too_long():
    sent = threading.Event()
    with peer(b"") as port:
        address = f"rerun+http://127.0.0.1:{port}/proxy"
        with pytest.raises(OSError, match="does not answer any more"):
            viewer.watched(sent.wait, address, patience=0.05, longest=0.3)
        threading.Timer(0.5, sent.set).start()
        viewer.watched(sent.wait, address, patience=0.05)
        sent.clear()
    with pytest.raises(OSError, match="does not answer any more"):
        viewer.watched(sent.wait, address, patience=0.05)
    sent.set()


def test_an_address_without_a_port_has_that_of_viewers():
    assert not viewer.answers("rerun+http://127.0.0.1:x")
    assert viewer.answers("rerun+http://127.0.0.1/proxy") == viewer.answers()


@pytest.mark.parametrize(("text", "words"), [
    ("echo no display >&2; exit 1", r"did not start \(no display\). Run where there is a display"),
    ("exit 0", "no viewer answers"),
])  # fmt: skip
def test_a_viewer_that_does_not_start_is_told_of(tmp_path, monkeypatch, text, words):
    started_by(monkeypatch, tmp_path, text)
    with pytest.raises(OSError, match=words):
        viewer.opened(None, home=f"rerun+http://127.0.0.1:{free_port()}/proxy", patience=0.3)


def test_an_open_viewer_is_used(tmp_path):
    with receiver(tmp_path / "sent.rrd") as address:
        assert viewer.answers(address)
        assert viewer.opened(None, home=address) == address
        assert viewer.opened(address) == address
        lw.record(fleet(3, 5), to=address)
