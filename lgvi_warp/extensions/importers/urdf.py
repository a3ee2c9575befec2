# SPDX-License-Identifier: Apache-2.0
"""Links and joints of a URDF. A xacro file, which is a program that writes a URDF, is refused."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.extensions.importers.links import Joint, Link, add_volumes, read_inertia, volume_of
from lgvi_warp.extensions.importers.poses import Pose, read_origin
from lgvi_warp.extensions.importers.robot_xml import TEMPLATES, numbers_in


def refuse_xacro(root: Element) -> None:
    """Refuse a file with elements of xacro; the message names the first."""
    for element in root.iter():
        if element.tag.startswith("xacro:"):
            shown = " ".join([element.tag, *(f'{key}="{value}"' for key, value in element.attrib.items())])[:80]
            problem = f"is xacro, a program that writes URDF and is not executed here; its first instruction: <{shown}>"
            raise SceneError([f"URDF {problem}. {capital(TEMPLATES['${'])}"])


def read_urdf(faults: Faults, root: Element) -> tuple[dict[str, Link], list[Joint]]:
    """Read the links and joints of a URDF file."""
    refuse_xacro(root)
    links = {link.name: link for link in (read_link(faults, element) for element in root.findall("link"))}
    joints, origins = [], {}
    for element in root.findall("joint"):
        ends = (element.find(tag) for tag in ("parent", "child"))
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        joints.append(Joint(element.get("type", ""), parent, child))
        origins[child] = (parent, read_origin(faults, f"{element.get('name', '')} ", element))
    place(faults, links, origins)
    return links, joints


def read_link(faults: Faults, element: Element) -> Link:
    """Read one link of a URDF file; a link without <inertial> is a frame without mass."""
    link = Link(element.get("name", ""))
    inertial = element.find("inertial")
    if inertial is not None:
        where = f"{link.name} "
        mass = inertial.find("mass")
        link.mass = float(numbers_in(faults, f"{where}<mass>", "" if mass is None else mass.get("value", ""), 1)[0])
        pose = read_origin(faults, where, inertial)
        link.center = pose.position
        inertia = read_inertia(faults, where, inertial.find("inertia"), "0")
        link.inertia = pose.rotation @ inertia @ pose.rotation.T
    shapes = []
    for i, collision in enumerate(element.findall("collision")):
        name = collision.get("name", f"collision {i}")
        where = f"{link.name} {name} "
        shapes.append((name, volume_of(faults, where, collision), read_origin(faults, where, collision).position))
    add_volumes(link, shapes)
    return link


def place(faults: Faults, links: dict[str, Link], origins: dict[str, tuple[str, Pose]]) -> None:
    """Set the pose of each link from the origins of the joints between the root and the link."""
    for name, link in links.items():
        above, passed = name, {name}
        while above in origins:
            above, pose = origins[above]
            link.pose = pose.then(link.pose)
            if above in passed:
                faults.add("<joint>", name, "is above itself", "correct <parent> and <child>")
                break
            passed.add(above)
