# SPDX-License-Identifier: Apache-2.0
"""Righting moments as Gazebo makes them, from robot descriptions: a small computation of its own beside the importers.

`python -m tests.support.righting FOLDER` prints the table of the files in a folder: SDF (a file NAME.world beside
NAME.sdf is the
world that the model is put into) and YAML of uuv_simulator. Nothing here uses the importers' code.
"""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from lgvi_warp.vehicles import from_sdf, from_yaml

SHAPES = {
    "box": lambda g: np.prod([float(x) for x in (g.findtext("size") or "1 1 1").split()]),
    "sphere": lambda g: 4.0 / 3.0 * np.pi * float(g.findtext("radius")) ** 3,
    "cylinder": lambda g: np.pi * float(g.findtext("radius")) ** 2 * float(g.findtext("length")),
    "capsule": lambda g: (
        np.pi
        * float(g.findtext("radius")) ** 2
        * (float(g.findtext("length")) + 4.0 / 3.0 * float(g.findtext("radius")))
    ),
    "ellipsoid": lambda g: 4.0 / 3.0 * np.pi * np.prod([float(x) for x in g.findtext("radii").split()]),
    "cone": lambda g: np.pi / 3.0 * float(g.findtext("radius")) ** 2 * float(g.findtext("length")),
}
TILT = 0.1  # rad
DOWN = np.diag([1.0, -1.0, -1.0])  # y to port, z up <-> y to starboard, z down


def tree(path):
    """The root of a file whose prefixes are not declared."""
    text = re.sub(r"<!--.*?-->", "", Path(path).read_text(), flags=re.DOTALL)
    text = re.sub(r"(?<=[</\s])(gz|ignition|experimental):", r"\1_", text)
    return ElementTree.fromstring(text.strip())


def matrix(element):
    """A <pose> as a 4x4 matrix."""
    M = np.eye(4)
    if element is not None and (element.text or "").strip():
        v = np.array([float(x) for x in element.text.split()])
        degrees = element.get("degrees") == "true"
        M[:3, :3] = Rotation.from_euler("xyz", v[3:], degrees=degrees).as_matrix()
        M[:3, 3] = v[:3]
    return M


def frames(model, origin):
    """Name -> 4x4 matrix in the top model, of the model's links and frames, and of those in nested models."""
    named = {child.get("name"): child for child in model if child.tag in ("link", "frame", "model")}

    def place(name):
        if name in ("", "__model__"):
            return origin
        child = named[name]
        pose = child.find("pose")
        relative_to = pose.get("relative_to", "") if pose is not None else ""
        M = place(relative_to or child.get("attached_to", "")) @ matrix(pose)
        if child.get("placement_frame"):
            M = M @ np.linalg.inv(frames(child, np.eye(4))[child.get("placement_frame")])
        return M

    found = {}
    for name, child in named.items():
        found[name] = place(name)
        if child.tag == "model":
            found |= {f"{name}::{key}": M for key, M in frames(child, found[name]).items()}
    return found


def links(model, prefix=""):
    """(full name, element) of each link."""
    for child in model:
        if child.tag == "link":
            yield prefix + child.get("name"), child
        elif child.tag == "model":
            yield from links(child, f"{prefix}{child.get('name')}::")


def water(world):
    """Density [kg/m3] and gravity [m/s2] of a <world>."""
    gravity = float((world.findtext("gravity") or "0 0 -9.8").split()[2])
    for plugin in world.findall("plugin"):
        if plugin.get("name", "").endswith("::Buoyancy"):
            text = plugin.findtext("uniform_fluid_density") or plugin.findtext("graded_buoyancy/default_density")
            return float(text or 1000.0), -gravity
    return 1000.0, -gravity


def enabled(world):
    """The models to which alone the Buoyancy plugin of a <world> is applied; none: all."""
    plugins = [] if world is None else world.findall("plugin")
    return [e.text.strip() for p in plugins if p.get("name", "").endswith("::Buoyancy") for e in p.findall("enable")]


def points(model, density, gravity, floats=True):
    """(point, force up) of each weight and each displaced volume, in the frame of the model, z up."""
    place = frames(model, np.eye(4))
    for name, link in links(model):
        M = place[name]
        mass = float(link.findtext("inertial/mass") or 1.0)
        center = matrix(link.find("inertial/pose"))[:, 3]
        yield (M @ center)[:3], -mass * gravity
        for collision in link.findall("collision"):
            for shape in collision.find("geometry"):
                if shape.tag in SHAPES and floats:
                    yield (M @ matrix(collision.find("pose")))[:3, 3], SHAPES[shape.tag](shape) * density * gravity


def moments(forces, attitudes):
    """Torque about the origin (n, 3), body axes z up, of forces (point, up) at attitudes (n, 3, 3), body to world."""
    total = np.zeros((len(attitudes), 3))
    for point, up in forces:
        total += np.cross(point, up * attitudes[:, 2, :])
    return total


def of_sdf(path, model, main, density=None, gravity=None):
    """Forces of Gazebo, about the origin of the main link and in its axes; density and gravity in their place."""
    root = tree(path)
    world = root.find("world")
    elements = {m.get("name"): m for m in root.iter("model")}
    rho, g = water(world) if world is not None else (density, gravity)
    M = np.linalg.inv(frames(elements[model], np.eye(4))[main])
    floats = not enabled(world) or model in enabled(world)
    return [(M[:3, :3] @ p + M[:3, 3], up) for p, up in points(elements[model], rho, g, floats)]


def of_yaml(path, gravity):
    """The weight at the centre of gravity and the displaced water's at that of buoyancy (axes z up)."""
    import yaml

    read = yaml.safe_load(Path(path).read_text())
    return [
        (np.array(read["cog"], float), -read["mass"] * gravity),
        (np.array(read["cob"], float), read["volume"] * read["density"] * gravity),
    ]


def of_tables(tables):
    """The same two forces from what an importer returned (axes z down), told in axes z up."""
    v = tables["vehicle"]
    return [(DOWN @ v["center_of_gravity"], -v["weight"]), (DOWN @ v["center_of_buoyancy"], v["buoyancy"])]


def tilts():
    """Attitudes (2, 3, 3): rolled and pitched by TILT."""
    return Rotation.from_euler("xyz", [[TILT, 0.0, 0.0], [0.0, TILT, 0.0]]).as_matrix()


def about_gravity(forces, attitudes):
    """Torque about the centre of the weights (n, 3): what turns the vehicle."""
    weights = [(p, up) for p, up in forces if up < 0.0]
    if not weights:  # no gravity
        return np.zeros((len(attitudes), 3))
    center = sum(up * p for p, up in weights) / sum(up for _, up in weights)
    return moments([(p - center, up) for p, up in forces], attitudes)


def rows(folder):
    """(name, ours (2,), theirs (2,)) of each file: moments about x when rolled, about y when pitched [N m]."""
    for path in sorted(Path(folder).rglob("*.sdf")):
        world = path.with_suffix(".world")
        beside = {"world": world} if world.exists() else {}
        root = tree(path)
        models = [m for m in root.findall("model") + root.findall("world/model") if m.find("link") is not None]
        for model in (m for m in models if m.findtext("static") not in ("true", "1")):
            name = model.get("name")
            tables = from_sdf(path, model=name, **beside)
            rho, g = (tables["environment"][key] for key in ("water_density", "gravity"))
            if beside:
                rho, g = water(tree(world).find("world"))
            plugin = next((p for p in model.findall("plugin") if p.find("link_name") is not None
                           and "ydrodynamics" in p.get("name", "")), None)  # fmt: skip
            main = plugin.findtext("link_name").strip() if plugin is not None else model.find("link").get("name")
            theirs = about_gravity(of_sdf(path, name, main, rho, g), tilts())
            yield f"{path.name}: {name}", np.diag(about_gravity(of_tables(tables), tilts())), np.diag(theirs)
    for path in sorted(Path(folder).rglob("*.yaml")):
        tables = from_yaml(path)
        theirs = about_gravity(of_yaml(path, tables["environment"]["gravity"]), tilts())
        yield path.name, np.diag(about_gravity(of_tables(tables), tilts())), np.diag(theirs)


def table(folder):
    """The table of a folder, as text."""
    lines = [
        f"| file | ours, rolled by {TILT} rad [N m] | Gazebo's | ours, pitched | Gazebo's |",
        "|---|---|---|---|---|",
    ]
    for name, ours, theirs in rows(folder):
        lines.append(f"| {name} | {ours[0]:.6g} | {theirs[0]:.6g} | {ours[1]:.6g} | {theirs[1]:.6g} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(sys.argv[1]))
