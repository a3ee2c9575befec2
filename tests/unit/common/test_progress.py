# SPDX-License-Identifier: Apache-2.0
"""Progress on terminals, in pipes and in notebooks, and `progress=True` of functions."""

import functools
import io
import time
import types
from contextlib import redirect_stderr
from typing import ClassVar

import pytest

import lgvi_warp as lw
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.common import progress as module
from lgvi_warp.common.progress import LateBar, Progress, callback, shows_if_long, shows_progress
from tests.support.refusals import says


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_lines_name_the_phase_and_the_time_left():
    stream = io.StringIO()
    progress = Progress(stream, interval=0.0)
    progress(0.0)
    progress(0.25)
    progress(0.5)
    progress.close()
    first, second, third = stream.getvalue().splitlines()
    assert first == "compiling, 0 s"
    assert second == "running 25.0%"
    assert third == "running 50.0%, 0 s left"


@pytest.mark.parametrize(
    ("interval", "begun", "shares", "lines"),
    [
        # 20 % in 10 s, so 70 % in 35 s; the minute of the compiler does not count.
        (0.0, 100.0, ((160.0, 0.1), (170.0, 0.3)), ["running 10.0%", "running 30.0%, 35 s left"]),
        # A pipe gets a line at most every ten seconds.
        (None, 0.0, ((1.0, 0.1), (9.0, 0.2), (10.0, 0.3), (15.0, 0.4), (20.5, 0.5)),
         ["running 30.0%, 32 s left", "running 50.0%, 24 s left"]),
    ],
)  # fmt: skip
def test_lines_of_a_pipe_and_the_time_left(interval, begun, shares, lines):
    now = [begun]
    stream = io.StringIO()
    progress = Progress(stream, clock=lambda: now[0], interval=interval)
    for now[0], share in shares:
        progress(share)
    progress.close()
    assert stream.getvalue().splitlines() == lines


def test_what_takes_long_without_a_fraction_is_shown_too():
    now = [0.0]
    stream = Terminal()
    progress = Progress(stream, "writing", clock=lambda: now[0])
    assert stream.getvalue() == "\rwriting, 0 s"
    now[0] = 7.0
    until = time.monotonic() + 10.0
    while "writing, 7 s" not in stream.getvalue():
        assert time.monotonic() < until
        time.sleep(0.05)
    progress.close()


def test_the_progress_line_is_clean_whatever_happens():
    stream = Terminal()
    at_once = functools.partial(Progress, interval=0.0)
    with pytest.raises(KeyboardInterrupt), redirect_stderr(stream), progress_bar(False, begin=at_once) as progress:
        progress(0.5)
        progress(0.75)
        raise KeyboardInterrupt
    first, second, third, blank, rest = stream.getvalue().removeprefix("\r").split("\r")
    assert first == "compiling, 0 s"
    assert "[############............] 50.0%" in second
    assert "75.0%, 0 s left" in third
    assert not blank.strip()
    assert not rest
    assert len(blank) >= len(third.rstrip())
    with progress_bar(True) as progress:
        assert progress is None


def test_a_long_line_is_blanked_by_a_short_one():
    stream = Terminal()
    progress = Progress(stream, "a long phase to begin with, and more than a bar of any width", interval=0.0)
    progress(1.0)
    progress.close()
    first, second, _, _ = stream.getvalue().removeprefix("\r").split("\r")
    assert len(second) == len(first) > len(second.rstrip())


@shows_progress
def work(shares, *, progress=None):
    """Use of progress by functions of the library."""
    report = callback(progress) or (lambda share: None)
    for share in shares:
        report(share)
    return progress


def test_a_function_is_called_as_before():
    told = []
    assert work([0.5, 1.0], progress=told.append) == told.append
    assert told == [0.5, 1.0]
    assert work([0.5]) is None
    assert work([0.5], progress=None) is None
    assert work.__name__ == "work"


def test_true_shows_and_false_is_silent():
    stream = Terminal()
    with redirect_stderr(stream):
        assert work([0.5], progress=False) is False
        assert stream.getvalue() == ""
        work([0.5], progress=True)
    assert stream.getvalue().startswith("\rcompiling")
    assert stream.getvalue().endswith("\r")


def test_true_is_cleaned_up_after_an_error():
    stream = Terminal()
    with redirect_stderr(stream), pytest.raises(TypeError):
        work(None, progress=True)
    assert stream.getvalue().endswith("\r")


@pytest.mark.parametrize("wrong", ["yes", 1.0, 3])
def test_what_is_no_function_is_refused(wrong):
    with pytest.raises(lw.SceneError, match=r"progress = .* is not a function. Give True"):
        work([], progress=wrong)


class FakeBar:
    """Part of tqdm that `NotebookBar` uses."""

    bars: ClassVar[list] = []

    def __init__(self, total, desc, bar_format):
        self.n, self.words, self.closed = 0.0, [desc], False
        self.bars.append(self)

    def set_description_str(self, text):
        self.words.append(text)

    def update(self, more):
        self.n += more

    def close(self):
        self.closed = True


def test_a_notebook_has_a_bar_of_tqdm():
    shown = module.bar(modules={"ipykernel": None}, load=lambda name: types.SimpleNamespace(tqdm=FakeBar))
    for share in (0.0, 0.25, 0.75):
        shown(share)
    shown.close()
    (bar,) = FakeBar.bars
    assert (bar.n, bar.words, bar.closed) == (0.75, ["compiling", "running"], True)


def test_a_notebook_without_tqdm_writes_in_place():
    def absent(name):
        raise ImportError(name)

    stream = io.StringIO()
    with redirect_stderr(stream):
        module.bar(modules={"ipykernel": None}, load=absent).close()
    assert stream.getvalue().startswith("\rcompiling")


def test_the_real_bar_of_tqdm_takes_the_same_calls():
    tqdm = pytest.importorskip("tqdm")
    stream = io.StringIO()
    bar = module.NotebookBar(lambda **settings: tqdm.tqdm(file=stream, mininterval=0.0, **settings))
    bar(0.5)
    bar(1.0)
    bar.close()
    says(stream.getvalue(), "100%", "running")


@pytest.mark.parametrize(
    "call",
    [
        lw.solve,
        lw.resume,
        lw.suggest,
        lw.tradeoff,
        lw.stability_map,
        lw.uq.evaluate,
        lw.tune_gains,
        lw.worst_case,
        lw.Prepared.__call__,
    ],
    ids=lambda call: call.__qualname__,
)
def test_every_long_call_takes_true(call):
    with pytest.raises(lw.SceneError, match="progress = 7 is not a function"):
        call(None, *[None] * (2 if call in (lw.tune_gains, lw.worst_case) else call is lw.uq.evaluate),
             *[1.0] * (call is lw.suggest), progress=7)  # fmt: skip


def test_a_bar_begins_late_where_a_call_takes_long():
    for pace, begun in ((0.2, [0.005, 0.5, 0.75]), (50.0, [])):  # 500 s and 2 s
        now, shown = [0.0], []
        late = LateBar(lambda shown=shown: Shown(shown), lambda now=now: now[0])
        for fraction in (0.005, 0.5, 0.75):
            now[0] = 10.0 * fraction / (0.1 * pace)
            late(fraction)
        late.close()
        assert shown == [*begun, "closed"][: len(begun) + bool(begun)]


class Shown:
    """Keeps what a bar is told."""

    def __init__(self, reported):
        self.told = reported

    def __call__(self, fraction):
        self.told.append(fraction)

    def close(self):
        self.told.append("closed")


def test_progress_is_shown_by_itself_on_a_terminal_alone(monkeypatch):
    told = []
    call = shows_if_long(lambda *, progress=None: told.append(progress))
    call()
    call(progress=False)
    monkeypatch.setattr(module.sys, "stderr", types.SimpleNamespace(isatty=lambda: True))
    call()
    call(progress=False)
    assert told[0] is None
    assert told[1] is told[3] is False
    assert isinstance(told[2], LateBar)
