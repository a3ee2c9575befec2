# SPDX-License-Identifier: Apache-2.0
"""The arrows between modules point one way (architecture, Layout), read from the source: lazy imports count as well."""

import ast
import re
import sys

import pytest

from tests.house.graph import ROOMS, Import, arrows_up, circle, circles_of_folders, closure, imports, modules

# What pyproject.toml declares, by import name; the optional ones take long to import, or may be absent.
OPTIONAL = {
    "SALib", "matplotlib", "rerun", "rerun_cli", "xarray", "zarr", "google_crc32c", "distributed", "netCDF4", "pyarrow",
    "PIL", "gymnasium", "tqdm", "control", "tomlkit", "h5netcdf", "h5py", "dask", "pyproj", "rasterio", "mcap", "mcap_ros2",
    "stable_baselines3", "shtab", "pandas", "contourpy", "gsw", "pythonfmu",
}  # fmt: skip
DEVICE_OF_EXTENSIONS, TWIN_OF_EXTENSIONS = (
    re.compile(rf"lgvi_warp\.extensions\.\w+\.{folder}\b") for folder in ("device", "twin")
)
DEPENDENCIES = {"numpy", "scipy", "warp"} | OPTIONAL


def within(name, package):
    """Whether a name is the package or lies in it."""
    return name == package or name.startswith(f"{package}.")


def part(package):
    """The modules of one package."""
    return {module: found for module, found in modules().items() if within(module, package)}


def strangers(package, allowed):
    """(module, name) for every import in a package from outside the allowed ones."""
    return [
        (module, found.name)
        for module, all_of_it in part(package).items()
        for found in all_of_it
        if found.kind != "typing" and not any(within(found.name, one) for one in allowed)
    ]


def importers(package, lazy=True):
    """Modules outside a package that import something of it; lazy=False leaves imports inside functions out."""
    return {
        module
        for module, all_of_it in modules().items()
        for found in all_of_it
        if within(found.name, package) and not within(module, package)
        if found.kind == "top" or (lazy and found.kind == "lazy")
    }


def imports_of(pattern):
    """(module, what it imports) of the modules whose names match."""
    return [(module, found) for module, all_of_it in modules().items() if pattern.match(module) for found in all_of_it]


def test_the_reader_finds_both_packages():
    some = {"lgvi_warp", "lgvi_warp.engine.plan", "lgvi_warp.reference.rotation", "lgvi_kernels.advance.kernel"}
    assert some <= modules().keys()
    assert all(part(package) for package in ("lgvi_warp.reference", "lgvi_warp.views", "lgvi_kernels.laws"))


@pytest.mark.parametrize(("source", "expected"), [
    ("import rerun as rr", [("rerun", "top")]),
    ("def f():\n    import rerun", [("rerun", "lazy")]),
    ("class A:\n    import rerun", [("rerun", "top")]),
    ("try:\n    from rerun import Mesh3D\nexcept ImportError:\n    pass", [("rerun.Mesh3D", "top")]),
    ("if TYPE_CHECKING:\n    import rerun\nelse:\n    import xarray", [("rerun", "typing"), ("xarray", "top")]),
    ("from lgvi_warp import views", [("lgvi_warp.views", "top")]),
    ("from . import plots", [("lgvi_warp.views.plots", "top")]),
    ("from ..results.result import Result", [("lgvi_warp.results.result.Result", "top")]),
])  # fmt: skip
def test_the_reader_sees_an_import(source, expected):
    assert imports(ast.parse(source), "lgvi_warp.views") == expected


def test_device_code_imports_warp_only():
    assert strangers("lgvi_kernels", {"lgvi_kernels", "warp"} | sys.stdlib_module_names) == []


def test_the_reference_imports_numpy_only():
    assert strangers("lgvi_warp.reference", {"lgvi_warp.reference", "numpy"} | sys.stdlib_module_names) == []


def test_the_product_imports_what_it_declares():
    ours = {"lgvi_warp", "lgvi_kernels"}
    assert strangers("lgvi_warp", ours | DEPENDENCIES | sys.stdlib_module_names) == []


def test_only_these_files_of_the_engine_know_the_kernels():
    those = {
        "lgvi_warp.engine.counted_draws", "lgvi_warp.engine.going_on", "lgvi_warp.engine.kernel",
        "lgvi_warp.engine.kernel_choice",
        "lgvi_warp.engine.kernel_spec", "lgvi_warp.engine.launches",
        "lgvi_warp.engine.packing", "lgvi_warp.engine.plan", "lgvi_warp.engine.plan_checks",
        "lgvi_warp.engine.sample_layout", "lgvi_warp.engine.packets", "lgvi_warp.engine.peak",
        "lgvi_warp.engine.state_lanes", "lgvi_warp.checks.bench",
        "lgvi_warp.checks.check", "lgvi_warp.checks.part_bench",
    }  # fmt: skip
    assert {module for module in importers("lgvi_kernels") if not DEVICE_OF_EXTENSIONS.match(module)} == those


def test_the_engine_knows_no_law_by_name():
    # Base classes, and what all laws share: a law says of itself what a kernel must know (`Term.exact_flow`, `carries` ...).
    general = {f"physics.terms.{name}" for name in ("base", "noisy", "events", "surface_level")}
    general |= {f"control.{name}" for name in ("base", "controller", "gain_tables", "signals")}
    single = {
        (module, found.name)
        for module, all_of_it in part("lgvi_warp.engine").items()
        for found in all_of_it
        if any(within(found.name, f"lgvi_warp.{room}") for room in ("physics.terms", "control"))
        if found.name != "lgvi_warp.physics.terms"
        if not any(within(found.name, f"lgvi_warp.{name}") for name in general)
    }
    assert single == set()


def test_nothing_of_the_product_uses_the_reference():
    assert {module for module in importers("lgvi_warp.reference") if not TWIN_OF_EXTENSIONS.match(module)} == set()


@pytest.mark.parametrize(("folder", "allowed"), [
    (DEVICE_OF_EXTENSIONS, {"lgvi_kernels", "warp"}), (TWIN_OF_EXTENSIONS, {"lgvi_warp.reference", "numpy"}),
])  # fmt: skip
def test_device_code_and_twins_of_an_extension_import_what_others_do(folder, allowed):
    known = allowed | sys.stdlib_module_names
    others = [(module, found.name) for module, found in imports_of(folder)
              if not any(within(found.name, one) for one in (*known, ".".join(module.split(".")[:4])))]  # fmt: skip
    assert others == []


def test_no_extension_imports_another():
    pairs = {(module, found.name) for module, found in imports_of(re.compile(r"lgvi_warp\.extensions\."))
             if within(found.name, "lgvi_warp.extensions")}  # fmt: skip
    assert [pair for pair in pairs if pair[0].split(".")[2] != pair[1].split(".")[2]] == []
    assert {module.split(".")[1] for module in importers("lgvi_warp.extensions")} == set()


def test_only_the_command_line_asks_for_sinks_and_late():
    assert importers("lgvi_warp.views", lazy=False) == set()
    assert all(within(module, "lgvi_warp.cli") for module in importers("lgvi_warp.views"))


@pytest.mark.parametrize("name", sorted(OPTIONAL | {"pandas"}))
def test_optional_packages_are_imported_late(name):
    assert importers(name, lazy=False) == set()


def test_a_scene_is_read_without_warp():
    modules = closure("lgvi_warp.cli") | closure("lgvi_warp.scene.file") | closure("lgvi_warp.scene.scene")
    assert {"lgvi_warp.scene.ensemble", "lgvi_warp.physics.vehicle"} <= modules
    assert modules & (importers("warp", lazy=False) | part("lgvi_kernels").keys()) == set()


def test_no_circle_and_no_arrow_up():
    # Imports inside functions and for typing counted; import-linter asserts the same of rooms (`make lint`).
    assert circle("top", "lazy", "typing") is None
    assert arrows_up() == []


def test_the_rooms_are_all_folders_but_the_twin():
    rooms = {name for floor in ROOMS for name in floor}
    folders = {module.split(".")[1] for module in part("lgvi_warp") if module.count(".") > 1}
    assert folders - rooms == {"reference"}
    assert rooms <= folders


def test_an_arrow_from_any_room_to_the_command_is_seen(monkeypatch):
    lowest = {room: min(module for module in part(f"lgvi_warp.{room}") if module.count(".") > 1)
              for floor in ROOMS for room in floor if room not in ("cli", "extensions")}  # fmt: skip
    for module in lowest.values():
        with monkeypatch.context() as patch:
            patch.setitem(modules(), module, [*modules()[module], Import("lgvi_warp.cli.command", "lazy")])
            assert (module, "lgvi_warp.cli.command") in arrows_up()


def test_no_folders_of_a_room_import_each_other():
    assert circles_of_folders() == {}
