# SPDX-License-Identifier: Apache-2.0
"""Summary of a finished run by the command, line by line, and which files it writes."""

import dataclasses
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.cli import documents, progress, report
from lgvi_warp.cli.arguments import parsed
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import MissingExtra
from lgvi_warp.common.phases import Phases
from lgvi_warp.common.status import WarningArray, Warnings
from tests.support.made import made
from tests.support.verbs import Study

MACHINE = {"checks": "safe", "machine": {"threads": 2, "cpu": "a cpu", "simd": "avx2"},
           "versions": {"numpy": "2", "warp": "1"}}  # fmt: skip


def told(members=4, k=3, provenance=None, **values):
    """A result of members that sink a little, as if a run had ended in it."""
    rising = np.arange(float(k))[:, None, None] * np.array([0.0, 0.0, 1.0])
    result = made(np.broadcast_to(rising, (k, members, 3)).copy(), **values)
    return dataclasses.replace(result, provenance=result.provenance | MACHINE | (provenance or {}))


def summary(result, drawn="same", **options):
    """The lines of a summary without files."""
    return report.summary(result, result if drawn == "same" else drawn, [], **options).split("\n")


def test_a_plain_run_is_summed_up():
    result = told()
    lines = summary(result)
    assert lines[0] == "members     4, psi_s, float64, step 0.01 s, 100 steps"
    assert lines[1].startswith("drift       ")
    assert lines[1].endswith(" (largest of all members)")
    assert lines[2:] == ["All 4 members end ok at 1 s."]
    verbose = summary(result, verbose=True)
    assert verbose[1] == "how         seed 1, checks safe, packets of 8, 2 threads on a cpu (avx2)"
    assert verbose[2] == "versions    numpy 2, warp 1"
    assert verbose[3:] == lines[1:]


def test_notes_come_first_and_the_speed_before_the_outcomes():
    result = dataclasses.replace(told(), messages=("odd", "odder"), run_seconds=0.5, compile_seconds=0.25)
    lines = summary(result, seconds=1.5)
    assert lines[:2] == ["note        odd", "note        odder"]
    assert lines[3] == "speed       800 vehicle-steps per second (0.50 s; kernel loaded in 0.25 s; 1.50 s in all)"
    compiled = dataclasses.replace(result, compile_phases=Phases(0.1, 2.0, 0.2))
    assert summary(compiled)[3:5] == [lines[3].replace("1.50", "0.00"),
                                      f"kernel      compiled: {Phases(0.1, 2.0, 0.2)}"]  # fmt: skip


def test_what_was_not_kept_is_said():
    bare = dataclasses.replace(told(), samples={})
    assert summary(bare, None)[1:-1] == report.unsaved(bare) == []
    whole = told()
    missing = {name: values for name, values in whole.samples.items() if name in ("position", "attitude")}
    text = "pictures    none, and no energy: velocity, angular_velocity not saved"
    assert summary(dataclasses.replace(whole, samples=missing), None)[1:-1] == [text]
    assert report.unsaved(whole) == []


def test_the_energy_is_that_of_the_members_drawn():
    result, few = told(), told(3)
    (line,) = report.energy_lines(result, few)
    assert line.endswith(" (largest of 3 of 4 members)")
    numbers = {"energy": 0.123456, "horizontal_momentum": 2.0, "vertical_angular_momentum": 3e-9}
    every = "drift       energy 0.12 J, horizontal momentum 2 N s, vertical angular momentum 3e-09 N m s"
    of_energy = "work        energy changed by up to 0.12 J, through drag, current (largest of all members)"
    for conserved, text in (({*numbers}, f"{every} (largest of all members)"), ({"horizontal_momentum"}, of_energy),
                            ({"energy"}, "drift       energy 0.12 J (largest of all members)")):  # fmt: skip
        assert report.drift_lines(numbers, conserved, ["drag", "current"], "all members") == [text]
    assert report.drift_lines(numbers | {"energy": np.nan}, {*numbers}, [], "all members") == []


def test_the_first_member_with_a_warning_is_named():
    bits = np.array([0, 2, 2, 3, 1], np.uint16).view(WarningArray)
    times, values = np.array([9.0, 3.0, 2.0, 4.0, 1.5]), np.array([0.0, 1.0, 1.23456, 8.0, 7.0])
    result = dataclasses.replace(told(5), warnings=bits, warning_time=times, warning_value=values)
    texts = [f"  {str(warning.name).lower()}: {warning.text} (first: member {member} at {time} s, "
             f"{warning.value_name} = {value})" for warning, member, time, value in ((Warnings.INERTIA, 4, "1.5", "7"),
                                                  (Warnings.PRECISION_LOSS, 2, "2", "1.235"))]  # fmt: skip
    assert summary(result)[-4:-1] == ["warnings    inertia 2, precision_loss 3", *texts]
    assert not any("warnings" in line for line in summary(told()))


def test_members_that_ask_for_too_much_are_counted():
    unmet = np.zeros((3, 4, 2))
    unmet[1, 2, 0], unmet[2, 3, 1] = 0.5, -0.5
    result = told()
    result = dataclasses.replace(result, samples=dict(result.samples) | {"unmet": unmet})
    text = "unmet       2 members asked at some sample for more than their actuators deliver"
    for most, shown in ((72, True), (71, False)):
        assert (text in summary(result, limit=most)) == shown


def test_a_controller_is_one_line():
    lists = {
        "sensors": [{"type": "sensor", "name": "compass"}, {"type": "sensor"}],
        "laws": [{"type": "pid"}], "guidance": [], "faults": [{"type": "stuck", "name": ""}],
    }  # fmt: skip
    said = report.controller_lines({"controller": {"period": 0.25, "delay": 0.5, **lists}})
    assert said == [
        "controller  acts every 0.25 s, 0.5 s until they act; sensors compass, sensor; laws pid; faults stuck"
    ]
    short = report.controller_lines({"controller": {"period": 2.0, "delay": 0.0, "laws": [{"type": "pid"}]}})
    assert short == ["controller  acts every 2 s; laws pid"]
    assert report.controller_lines({"controller": None}) == []


def test_a_chosen_method_has_its_reason():
    settings = {"method": {"name": "psi_x", "chosen": "since drag acts"}, "dtype": "float32", "step": 0.25,
                "steps": 4000}  # fmt: skip
    text = "members     1,200, psi_x, float32, step 0.25 s, 4,000 steps\nmethod      psi_x, chosen since drag acts"
    assert report.members_line(1200, settings) == text


def test_files_have_their_sizes_and_ways_to_look(tmp_path):
    (tmp_path / "a.png").write_bytes(b"x" * 1_260_000)
    store = tmp_path / "run.zarr"
    store.mkdir()
    (store / "b").write_bytes(b"x" * 2_000_000)
    assert report.file_line(tmp_path / "a.png") == f"file        {tmp_path}/a.png (1.3 MB)"
    assert report.file_line(store) == f"file        {store} (2.0 MB)"
    names = [Path("o") / name for name in ("result.npz", "fleet.png", "fleet.rrd", "statistics.png")]
    assert report.look_lines(names) == ["look        rerun o/fleet.rrd, or open o/fleet.png"]
    assert report.look_lines(names[:2]) == ["look        open o/fleet.png"]
    assert report.look_lines(names[2:3]) == ["look        rerun o/fleet.rrd"]
    assert report.look_lines([Path("o/a/run.zarr"), names[0]]) == ["look        lgvi-warp info o/a"]
    assert report.look_lines([]) == []


def test_members_that_are_drawn():
    result = told()
    assert report.shown_members(result) is result
    bare = dataclasses.replace(result, samples={}, kept=None)
    assert report.shown_members(bare) is None
    assert report.shown_members(dataclasses.replace(bare, kept=result)) is result
    few = dataclasses.replace(result, samples={"position": result.position})
    assert report.shown_members(few) is None


class Stored(dict):
    """Samples as a store has them: those of some members are read at once."""

    def part(self, members):
        return {name: values[:, members] for name, values in self.items()}


def test_of_a_large_store_some_members_are_drawn():
    whole = told(6)
    result = dataclasses.replace(whole, store=Path("run.zarr"), samples=Stored(whole.samples))

    def drawn(result, limit):
        return list(report.shown_members(result, limit=limit, load=lambda whole, members: members))

    assert drawn(result, 18 * 3 * 6) == list(range(6))
    for limit, most in ((18 * 3 * 6 - 1, 5), (18 * 3 * 2, 2), (1, 1)):
        assert drawn(result, limit) == list(lw.select_members(whole, most).members)
        assert len(drawn(result, limit)) == most
    lost = Stored({name: values * np.nan for name, values in whole.samples.items()})
    assert drawn(dataclasses.replace(result, samples=lost), 1) == [0]  # each picture says why it is none


def test_files_that_a_run_has(tmp_path):
    result, few = told(), told(2)
    assert list(report.pictures(result, few)) == ["fleet.png", "fleet.rrd"]
    assert report.pictures(result, None) == {}
    # A viewer that does not answer gets nothing, and the file is written.
    record = report.pictures(result, few, "rerun+http://127.0.0.1:9/proxy")["fleet.rrd"]
    assert record(tmp_path / "a.rrd") == tmp_path / "a.rrd"
    assert (tmp_path / "a.rrd").stat().st_size > 1000
    written = report.write(result, None, tmp_path)
    assert written.files == [tmp_path / "result.npz"]
    assert lw.Result.load(tmp_path / "result.npz").members == 4
    stored = dataclasses.replace(result, store=tmp_path / "run.zarr")
    assert report.write(stored, None, tmp_path / "b").files == [tmp_path / "run.zarr"]
    (tmp_path / "file").touch()
    (fault,) = report.write(told(), None, tmp_path / "file" / "c").faults
    assert fault.startswith(f"{tmp_path}/file/c/result.npz was not written: ")


def test_the_end_of_a_run_is_told(tmp_path, capsys):
    result, written = told(), Written([tmp_path / "fleet.png"], ["a fault"], ["a is empty"])
    written.missing["a.rrd"] = MissingExtra("recordings", "rerun-sdk", "viz")
    (tmp_path / "fleet.png").write_bytes(b"x")
    writing = Study(written)
    chosen = parsed(["run", "scene.toml", "-v"])
    begun = time.perf_counter() - 5.0
    result = dataclasses.replace(result, run_seconds=1.0)
    assert report.report(result, tmp_path, chosen, begun, ["b"], "a viewer", writer=writing) == ["a fault", "b"]
    assert writing.calls == [((result, result, tmp_path, "a viewer"), {})]
    out, err = capsys.readouterr()
    lines = out.split("\n")
    assert lines[0].startswith("note        a.rrd: not made without rerun-sdk")
    assert lines[1].startswith("members     4")
    assert "; 5.0" in out
    assert lines[2].startswith("how  ")
    assert err == "lgvi-warp: a is empty\n"
    assert lines[-4].startswith("file        ")
    assert lines[-3] == f"look        open {tmp_path}/fleet.png"
    assert lines[-2:] == ["All 4 members end ok at 1 s.", ""]


def test_a_part_of_a_run_is_to_be_merged(tmp_path, capsys):
    part = lambda path: SimpleNamespace(complete=False)  # noqa: E731
    stored = dataclasses.replace(told(1200), store=tmp_path / "run.zarr")
    assert report.report(stored, tmp_path, parsed(["run", "scene.toml"]), 0.0, ["b"], store=part) == ["b"]
    merge = f"next        lgvi-warp merge {tmp_path} ... --out DIR, with the folders of the other parts"
    assert capsys.readouterr() == (f"members     1,200 of a run in parts, in {tmp_path}/run.zarr\n{merge}\n", "")


def test_documents_of_a_run(tmp_path):
    """Parts that no recorded run has (tests/data/pictures.json).

    Times, faults and files that are missing, some members drawn.
    """
    result = dataclasses.replace(told(), substeps=np.array([0, 1, 5, 0]), run_seconds=0.5, compile_seconds=0.25)
    written = Written([tmp_path / "a"], ["a fault"], ["empty"], {"a.png": MissingExtra("plots", "matplotlib", "viz")})
    content = documents.of_run(result, told(3), written, ["b"], 2.5)
    assert content["divided"] == {"members": 2, "steps": 6}
    assert content["seconds"] == {"compile": 0.25, "run": 0.5, "all": 2.5}
    assert content["vehicle_steps_per_second"] == 800.0
    assert content["faults"] == ["a fault", "b"]
    assert content["files"] == [tmp_path / "a"]
    assert content["notes"] == ["empty", *written.note_lines()]
    assert (content["energy"]["members"], content["energy"]["all"]) == (3, False)
    assert documents.of_energy(told(3), 3)["all"]
    assert documents.of_energy(None, 3) is None
    bare = documents.of_run(dataclasses.replace(result, samples={}, run_seconds=0.0), told(3), written, [], 0.0)
    assert bare["energy"] is None
    assert bare["vehicle_steps_per_second"] is None
    stored = documents.of_store({"blocks": 3, "provenance": result.provenance})
    assert stored == {"blocks": 3, "settings": content["settings"]}
    named = SimpleNamespace(steps=4)
    named.seconds = 3.0
    assert documents.of_prediction(named) == {"steps": 4, "seconds": 3.0}


@pytest.mark.parametrize(("quiet", "kind"), [(True, type(None)), (False, progress.Progress)])
def test_progress_is_shown_and_closed(quiet, kind):
    ended = []

    class Closing(progress.Progress):
        def close(self):
            ended.append(self)
            super().close()

    with pytest.raises(ZeroDivisionError), progress.progress_bar(quiet, begin=Closing) as shown:
        assert isinstance(shown, kind)
        assert not ended
        raise ZeroDivisionError
    assert ended == ([] if quiet else [shown])


def test_the_progress_of_a_part_is_that_of_the_whole():
    fractions = []
    assert progress.part_of(None, 0, 2) is None
    for i in range(4):
        progress.part_of(fractions.append, i, 4)(0.5)
    assert fractions == [0.125, 0.375, 0.625, 0.875]
