# SPDX-License-Identifier: Apache-2.0
"""A disk that is full after any number of bytes: each writer says so, and leaves the earlier file whole and nothing open."""

import contextlib
import os
import resource
import signal
import warnings

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common import files, tables

pytest.importorskip("matplotlib")
ENDINGS = (".csv", ".parquet", ".nc", ".geojson", ".kml", ".mcap")
PICTURES = ("png", "pdf", "svg", "jpg")
MOVIES = ("webp", "gif", "png")


@pytest.fixture(scope="module")
def run():
    """A few members with depths and places."""
    scene = lw.Scene.named("sphere", start={"velocity": [1.0, 0.0, 0.2]},
                           environment={"origin": [54.0, 8.0], "start": "2024-05-01T00:00"})  # fmt: skip
    fleet = lw.Ensemble(scene, members=3, vary={"vehicle.buoyancy": lw.distributions.Normal(std=0.1)})
    return lw.solve(fleet, "psi_s", h=0.1, t1=2.0, save=lw.SaveAt(every=0.1))


def picture(path):
    from matplotlib.figure import Figure

    from lgvi_warp.views.plots.canvas import save_figure

    figure = Figure(figsize=(3.0, 2.0))
    figure.subplots().plot(np.random.default_rng(1).normal(size=300))
    return lambda: save_figure(figure, path)


def moving(path):
    from PIL import Image

    from lgvi_warp.views.recording.movie import save

    rng = np.random.default_rng(2)
    pictures = [Image.fromarray(rng.integers(0, 255, (40, 60, 3), np.uint8)) for _ in range(3)]
    return lambda: save(iter(pictures), path, 1.0)


def writers(run, folder):
    """Writers of files, by the name of the file."""
    rows = [{"a": i, "b": f"text {i}"} for i in range(500)]
    made = {
        f"run{ending}": (lambda to=folder / f"run{ending}": lw.export(run, to=to, overwrite=True)) for ending in ENDINGS
    }
    made |= {f"picture.{ending}": picture(folder / f"picture.{ending}") for ending in PICTURES}
    made |= {f"movie.{ending}": moving(folder / f"movie.{ending}") for ending in MOVIES}
    made |= {
        "run.rrd": lambda: lw.record(run, folder / "run.rrd"),
        "result.npz": lambda: run.save(folder / "result.npz"),
        "report.html": lambda: lw.report(run, folder / "report.html"),
        "table.csv": lambda: tables.write_csv(rows, folder / "table.csv"),
        "text.md": lambda: files.write_text(folder / "text.md", "line\n" * 500),
    }
    return made


NAMES = [f"run{ending}" for ending in (*ENDINGS, ".rrd")] + [f"picture.{ending}" for ending in PICTURES]
NAMES += [f"movie.{ending}" for ending in MOVIES]
NAMES += ["result.npz", "report.html", "table.csv", "text.md"]


@contextlib.contextmanager
def room(size):
    """In the context no file of this process grows beyond so many bytes."""
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, old)


def open_files(folder):
    """Files of a folder that are open."""
    links = []
    for name in os.listdir("/dev/fd"):
        with contextlib.suppress(OSError):
            links.append(os.readlink(f"/dev/fd/{name}"))
    return [link for link in links if link.startswith(str(folder))]


@pytest.mark.ci
@pytest.mark.skipif(not os.path.isdir("/dev/fd"), reason="the system lists no open files")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("parts", [4, pytest.param(60, marks=pytest.mark.slow)])
def test_a_disk_that_is_full_at_any_place(name, parts, run, tmp_path):
    write = writers(run, tmp_path)[name]
    write()
    path = tmp_path / name
    content = path.read_bytes()
    # A recording is a few bytes longer or shorter each time.
    last = len(content) - (len(content) // 50 if name.endswith(".rrd") else 1)
    for size in sorted({0, 1, last, *(len(content) * k // parts for k in range(parts))}):
        path.write_bytes(b"good")
        with warnings.catch_warnings():
            warnings.simplefilter("error", ResourceWarning)
            with room(max(size, 4)), pytest.raises((OSError, lw.SceneError)) as error:
                write()
        assert len(str(error.value).splitlines()) == 1
        assert path.read_bytes() == b"good"
        assert [one.name for one in tmp_path.iterdir()] == [name]
        del error
        assert open_files(tmp_path) == []
    write()
    assert len(path.read_bytes()) > 4
