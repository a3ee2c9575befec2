# SPDX-License-Identifier: Apache-2.0
"""Files are read by `common.reading` and written by `common.files`, which look at what they are; nothing else opens one."""

import ast

import pytest

from tests.conftest import ROOT

# Calls that open, read, write or replace a file, by the last parts of their names. Of `x.open(...)` those with a mode.
FORBIDDEN = {
    "read_text", "read_bytes", "write_text", "write_bytes", "open", "os.open", "os.fdopen", "os.replace", "os.rename",
    "io.open", "io.FileIO", "json.load", "json.loads", "tomllib.load", "tomllib.loads", "pickle.load", "pickle.loads",
    "np.load", "np.save", "np.savez", "np.savez_compressed", "np.loadtxt", "np.genfromtxt", "np.fromfile", "np.memmap",
    "savetxt", "tofile", "zipfile.ZipFile", "shutil.copy", "shutil.copyfile", "shutil.copytree", "shutil.move", "linecache",
}  # fmt: skip
# Own functions of these names, and files that are no user's.
ALLOWED = {
    ("extensions/others/fmu/archive.py", "read_bytes"): "files of an installed library, and of this package",
    ("extensions/others/fmu/archive.py", "zipfile.ZipFile"): "a unit that is written, by `new_file`",
    ("extensions/others/fmu/slave.py", "json.loads"): "a state that the unit itself made, in the memory of who runs it",
    ("engine/kernel_cache.py", "json.loads"): "the cache of kernels, which only this package writes, by checksums",
    ("engine/kernel_cache.py", "read_bytes"): "the same",
    ("engine/kernel_cache.py", "write_text"): "the same, in a scratch folder of the process",
    ("engine/kernel_cache.py", "shutil.copyfile"): "the same",
    ("engine/kernel_cache.py", "os.open"): "a folder, to lock it",
    ("store/block_files.py", "np.save"): "into memory",
    ("cli/command.py", "os.open"): "the null device in the place of a closed stream",
    ("cli/signals.py", "open"): "the end of a pipe of its own",
    ("engine/executors/base.py", "pickle.loads"): "what a process sends to its own workers",
    ("calls/warm.py", "pickle.loads"): "the same",
    ("store/exporting/netcdf_files.py", "os.open"): "the null device",
    ("extensions/importers/yaml.py", "read_text"): "a function of that name, which goes through reading",
    ("lanes/overloads.py", "read_bytes"): "the text of its own folder, for the hash of kernels",
}


def called(node):
    """The forbidden name that a call has, or None."""
    if isinstance(node.func, ast.Name):
        return "open" if node.func.id == "open" else None
    if not isinstance(node.func, ast.Attribute):
        return None
    name = node.func.attr
    whose = node.func.value.id if isinstance(node.func.value, ast.Name) else ""
    if f"{whose}.{name}" in FORBIDDEN:
        return f"{whose}.{name}"
    if name == "open":
        mode = node.args[0] if node.args else next((item.value for item in node.keywords if item.arg == "mode"), None)
        if not node.args and mode is None:
            return "open"
        return "open" if isinstance(mode, ast.Constant) and str(mode.value)[:1] in "rwxa" else None
    return name if name in FORBIDDEN else None


def imported(node):
    """Forbidden names that an import gives other names, so that a call would not show them."""
    if isinstance(node, ast.ImportFrom):
        module = {"numpy": "np"}.get(node.module, node.module)
        return [name for item in node.names if (name := f"{module}.{item.name}") in FORBIDDEN]
    usual = {"numpy": "np"}
    return [f"{item.name} as {item.asname}" for item in node.names
            if item.asname not in (None, usual.get(item.name))
            and any(name.startswith(f"{usual.get(item.name, item.name)}.") for name in FORBIDDEN)]  # fmt: skip


def opened(source):
    """(line, name) of each call that opens a file in a source, and of each import that hides one."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found += [(node.lineno, name) for name in imported(node)]
        elif isinstance(node, ast.Call) and (name := called(node)) is not None:
            found.append((node.lineno, name))
    return found


@pytest.mark.parametrize(("source", "expected"), [
    ("json.loads(Path(p).read_text())", {"json.loads", "read_text"}),
    ("import numpy as np\nx = np.load(p)", {"np.load"}), ("with path.open('rb') as file: pass", {"open"}),
    ("with open(path) as file: pass", {"open"}), ("with path.open() as file: pass", {"open"}),
    ("from json import dumps, loads", {"json.loads"}), ("from numpy import load as read", {"np.load"}),
    ("import numpy as numbers, json, os", {"numpy as numbers"}),
    ("statistic.open(time, 3); webbrowser.open(uri); text.replace('a', 'b')", set()),
])  # fmt: skip
def test_the_reader_sees_what_opens_a_file(source, expected):
    assert {name for _, name in opened(source)} == expected


def test_only_one_pair_of_functions_opens_files():
    found = {}
    for package in ("lgvi_warp", "kernels/lgvi_kernels"):
        for path in sorted((ROOT / package).rglob("*.py")):
            key = path.relative_to(ROOT / package).as_posix()
            if package == "lgvi_warp" and key.startswith("common/"):
                continue
            for line, name in opened(path.read_text(encoding="utf-8")):
                found.setdefault((key, name), []).append(line)
    assert {key: lines for key, lines in found.items() if key not in ALLOWED} == {}
    assert ALLOWED.keys() - found.keys() == set()  # no exception outlives its reason
