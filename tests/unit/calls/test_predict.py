# SPDX-License-Identifier: Apache-2.0
"""Knowledge of the machine before a run."""

from pathlib import Path

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.store.create import nearest_folder


def test_the_memory_of_this_process(monkeypatch):
    held = np.ones(30_000_000)
    assert machine.resident() > held.nbytes
    for error in (OSError, ValueError):
        monkeypatch.setattr(Path, "read_text", lambda *_, error=error: (_ for _ in ()).throw(error()))
        assert machine.resident() == 0


def test_the_nearest_folder_that_exists(tmp_path):
    (tmp_path / "file").touch()
    for name in (".", "a", "a/b/c", "file/x"):
        assert nearest_folder(tmp_path / name) == tmp_path
