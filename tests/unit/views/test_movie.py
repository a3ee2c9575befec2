# SPDX-License-Identifier: Apache-2.0
"""Moving pictures: as many frames as asked for, in which things move; drawn plainly where no viewer can draw."""

import numpy as np
import pytest
from PIL import Image

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.views.recording import headless, movie
from tests.support.made import made


def fleet_result():
    """Five members that sink side by side; the last is on the floor after 10 s."""
    time = np.linspace(0.0, 30.0, 31)
    position = np.ones((31, 5, 3)) * np.arange(5)[:, None] + time[:, None, None]
    position[11:, 4] = position[10, 4]
    status, end = np.full(5, Status.OK), np.full(5, np.nan)
    status[4], end[4] = Status.FLOOR, 10.0
    return made(position, time, status=status, end=end)


def frames_of(path):
    """Pictures (n, height, width, 3), and how long each is shown [ms]."""
    with Image.open(path) as picture:
        found, times = [], []
        for i in range(picture.n_frames):
            picture.seek(i)
            found.append(np.asarray(picture.convert("RGB")).astype(int))
            times.append(picture.info.get("duration"))
    return np.array(found), times


@pytest.mark.ci
@pytest.mark.parametrize("ending", movie.ENDINGS)
def test_a_plain_one_has_its_frames_and_things_move(ending, tmp_path):
    path = lw.plots.movie(fleet_result(), tmp_path / f"fleet{ending}", frames=4, seconds=2.0, by="plot")
    pictures, times = frames_of(path)
    assert len(pictures) == 4
    assert all(np.abs(after - before).max() > 100 for before, after in zip(pictures, pictures[1:], strict=False))
    assert ending == ".webp" or times[-1] == 500


def test_a_line_stops_where_its_member_did(monkeypatch):
    """In the last picture each line has its member's samples up to its end, and no more."""
    kept = []
    monkeypatch.setattr("matplotlib.axes.Axes.plot", lambda axes, *a, _plot=__import__("matplotlib.axes").axes.Axes.plot, **k:
                        kept.append(_plot(axes, *a, **k)) or kept[-1])  # fmt: skip
    list(movie.plainly(fleet_result(), None, 2))
    lengths = [len(lines[0].get_xdata()) for lines in kept]
    assert lengths == [31, 31, 31, 31, 11] * 2 + [5]


def test_without_a_driver_it_is_drawn_plainly(tmp_path, monkeypatch):
    def shots(*_):
        raise headless.DriverMissingError("no Vulkan driver")
        yield

    monkeypatch.setattr(headless, "shots", shots)
    assert movie.write(fleet_result(), tmp_path / "fleet.gif", frames=2) == "plot"
    with pytest.raises(OSError, match=r'cannot draw on this machine: no Vulkan driver. Give by="plot"'):
        lw.plots.movie(fleet_result(), tmp_path / "other.gif", frames=2, by="viewer")
    assert not (tmp_path / "other.gif").exists()


def test_faults_are_named_at_once(tmp_path):
    with pytest.raises(lw.SceneError) as caught:
        lw.plots.movie(fleet_result(), tmp_path / "fleet.mp4", frames=1.5, seconds=0.0, by="hand")
    text = str(caught.value)
    assert all(words in text for words in ("has an ending", "frames", "seconds", "by = 'hand'"))
    with pytest.raises(lw.SceneError):
        lw.plots.movie(fleet_result(), tmp_path / "fleet.gif", members=[7], by="plot")


@pytest.mark.slow
def test_the_viewer_is_shot(tmp_path):
    try:
        lw.plots.movie(fleet_result(), tmp_path / "fleet.webp", frames=3, by="viewer")
    except OSError as error:
        pytest.skip(str(error))
    pictures, _ = frames_of(tmp_path / "fleet.webp")
    assert pictures.shape == (3, 515, 880, 3)
    assert np.abs(pictures[2] - pictures[0]).max() > 100
