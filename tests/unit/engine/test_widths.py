# SPDX-License-Identifier: Apache-2.0
"""Vehicles per packet: by the table, as measured on this machine, or as asked for; files of others are ignored."""

import json
import os

import pytest

from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_warp.common import machine
from lgvi_warp.engine import widths
from lgvi_warp.engine.widths import path as path_of_users
from lgvi_warp.measuring import speed
from lgvi_warp.results.provenance import provenance
from lgvi_warp.runs.settle import make_plan

EPYC, XEON = "AMD EPYC 9654", "Intel(R) Xeon(R) Platinum 8481C"
DTYPES = ("float64", "float32", "float32_compensated")


@pytest.fixture
def file(measured_widths):
    """A file of measured widths that does not exist yet."""
    return measured_widths


@pytest.mark.parametrize(
    ("cpu", "simd", "kind", "lanes"),
    [(EPYC, "avx512", "plain", (16, 16, 16)), (EPYC, "avx512", "chained", (16, 32, 16)),
     (EPYC, "avx512", "dense", (8, 16, 16)), (EPYC, "avx512", "single", (8, 16, 16)), (XEON, "avx512", "single", (16, 32, 16)),
     (XEON, "avx512", "plain", (16, 32, 16)), (XEON, "avx512", "chained", (16, 32, 16)),
     (XEON, "avx512", "explicit", (8, 16, 16)), (XEON, "avx2", "chained", (4, 8, 8)),
     ("Neoverse", "neon", "plain", (4, 8, 4)), ("Neoverse", "neon", "explicit", (4, 8, 4)),
     ("Power", "other", "plain", (2, 4, 4))],
)  # fmt: skip
def test_the_table(cpu, simd, kind, lanes):
    chosen = [widths.of_table(kind, dtype, cpu=cpu, simd=simd) for dtype in DTYPES]
    assert tuple(width.lanes for width in chosen) == lanes
    assert all(width.source.startswith("table: ") and width.source.endswith(simd) for width in chosen)
    assert all("Intel" not in width.source or cpu == XEON for width in chosen)


def test_every_extension_is_one_that_is_looked_for():
    from numpy._core._multiarray_umath import __cpu_features__ as known

    assert set(machine.FEATURES.values()) <= set(known)
    assert machine.REGISTER_BYTES.keys() == {*machine.FEATURES, "other"}
    assert machine.simd() in machine.REGISTER_BYTES


def test_kernels_have_these_widths():
    assert widths.WIDTHS == WIDTHS


def test_kept_widths_count_on_this_machine_alone(file, monkeypatch):
    assert widths.measured() == {}
    widths.keep_measured("a", 4)
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(widths, "this_machine", lambda: "another")
        widths.keep_measured("a", 8)
        assert widths.measured() == {"a": 8}
        widths.read_hashes.cache_clear()
    assert widths.measured() == {"a": 4}
    assert len(json.loads(file.read_bytes())) == 2


def test_the_width_of_one_kernel_counts_for_that_kernel_alone(file):
    plan = make_plan(speed.fleet(2), "psi_s", h=0.01, t1=0.1)
    widths.keep_measured("0" * 64, 4)
    assert make_plan(speed.fleet(2), "psi_s", h=0.01, t1=0.1).spec.width == plan.spec.width
    widths.keep_measured(plan.kernel.hash, 4)
    chosen = make_plan(speed.fleet(2), "psi_s", h=0.01, t1=0.1)
    assert (chosen.spec.width, chosen.width_source) == (4, "measured")
    assert make_plan(speed.fleet(2), "psi_s", h=0.01, t1=0.1, width=2).spec.width == 2
    assert make_plan(speed.fleet(2), "psi_x", h=0.01, t1=0.1).width_source.startswith("table")


def test_a_full_file_loses_the_oldest_kernel(file, monkeypatch):
    monkeypatch.setattr(widths, "MOST_HASHES", 3)
    for kernel in "abcda":
        widths.keep_measured(kernel, 8)
    assert list(widths.measured()) == ["c", "d", "a"]


def contents():
    """Contents of a file that are no widths, or none of this machine's."""
    key = widths.this_machine()
    odd = [{widths.HASHES: {"a": width}} for width in (3, 0, -8, True, 8.0, "8", None, [8], 2**70)]
    odd += [{"a": 8}, [8], 8, None, "a", *({widths.HASHES: kernels} for kernels in ([8], 8, None, "a"))]
    texts = [json.dumps({key: one}) for one in odd] + [json.dumps({"another": {widths.HASHES: {"a": 4}}})]
    return [
        *map(str.encode, texts), b"", b"[]", b"8", b"{", b"\xff\xfe", b"[" * 100_000, b" " * (widths.MOST_BYTES + 1),
    ]  # fmt: skip


def test_foreign_files_are_ignored(file):
    for content in contents():
        file.write_bytes(content)
        widths.read_hashes.cache_clear()
        assert widths.measured() == {}, content[:100]
    # What is whole beside them counts.
    file.write_text(json.dumps({widths.this_machine(): {widths.HASHES: {"a": 3, "b": 8}}}))
    widths.read_hashes.cache_clear()
    assert widths.measured() == {"b": 8}


def test_what_is_no_file_is_ignored(file):
    file.mkdir()
    widths.read_hashes.cache_clear()
    assert widths.measured() == {}
    file.rmdir()
    os.mkfifo(file)
    widths.read_hashes.cache_clear()
    assert widths.measured() == {}
    file.unlink()
    file.write_text(json.dumps({widths.this_machine(): {widths.HASHES: {"a": 4}}}))
    file.chmod(0)
    widths.read_hashes.cache_clear()
    assert widths.measured() == ({"a": 4} if os.geteuid() == 0 else {})


def test_beside_the_kernel_caches(monkeypatch, tmp_path):
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path))
    assert path_of_users() == tmp_path / widths.FILE
    monkeypatch.delenv("WARP_CACHE_PATH")
    assert path_of_users().parent.name == "warp"


@pytest.mark.kernel
def test_provenance_says_what_chose(file):
    def plan(**named):
        return make_plan(speed.fleet(2), "psi_s", h=0.01, t1=0.1, **named)

    assert provenance(plan())["machine"]["width_source"].startswith("table")
    widths.keep_measured(plan().kernel.hash, 4)
    chosen = provenance(plan())
    assert (chosen["width"], chosen["machine"]["width_source"]) == (4, "measured")
    asked = provenance(plan(width=2))
    assert (asked["width"], asked["machine"]["width_source"]) == (2, "asked for")
