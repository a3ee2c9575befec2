# SPDX-License-Identifier: Apache-2.0
"""Includes of an SDF file, replaced by files that the user names; no path or address in the SDF file is opened."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from lgvi_warp.common.errors import SceneError, closest, refusal
from lgvi_warp.extensions.importers.robot_xml import MOST_ELEMENTS, is_true, parse_xml, text_of

# Models within models that are put in place.
MOST_NESTED = 8


def put_in_place(root: Element, given: Any) -> None:
    """Replace each <include> whose <name>, <uri> or last part of the <uri> is in a map of paths or texts by its model."""
    if not (isinstance(given, Mapping) and all(isinstance(each, str | os.PathLike) for each in given.values())):
        raise refusal(
            "include", given, "is not a map of files", "give include={'tethys': 'model.sdf'}: a path or text by name"
        )
    files = {name: parse_xml(source, f"include {name!r}") for name, source in given.items()}
    used: set[str] = set()
    known: set[str] = set()
    size = _put(root, files, used, known, 0)
    if unused := [name for name in files if name not in used]:
        remedy = closest(unused[0], sorted(known)) if known else "leave it out: it includes nothing"
        raise refusal("include", unused[0], "is none that the file includes", remedy)
    if size > MOST_ELEMENTS:
        raise SceneError([f"SDF include: makes more than {MOST_ELEMENTS:,} elements. Give the vehicle alone"])


def _put(root: Element, files: Mapping[str, Element], used: set[str], known: set[str], depth: int) -> int:
    """Replace the includes below an element by models; return the number of elements afterwards."""
    if depth > MOST_NESTED:
        raise SceneError([f"SDF include is nested more than {MOST_NESTED} deep, or in a circle. Correct the files"])
    size = sum(1 for _ in root.iter())
    for parent in [element for element in root.iter() if element.find("include") is not None]:
        for place, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                continue
            names = names_of(child)
            known.update(names)
            name = next((each for each in names if each in files), None)
            if name is None:
                continue
            used.add(name)
            model = _model(files[name], name, child)
            size += _put(model, files, used, known, depth + 1)
            if size > MOST_ELEMENTS:
                return size
            parent[place : place + 1] = _merged(model, name) if is_true(child.get("merge")) else [model]
    return size


def names_of(include: Element) -> list[str]:
    """Names of an <include>: its <name>, its <uri>, and the last part of its <uri>, also without %20."""
    uri = text_of(include.find("uri"))
    last = uri.rstrip("/").rpartition("/")[2]
    return [each for each in dict.fromkeys((text_of(include.find("name")), uri, last, unquote(last))) if each]


def _model(root: Element, name: str, include: Element) -> Element:
    """A copy of the model of a file, with the name, pose, static flag and added plugins of its <include>."""
    found = root if root.tag == "model" else root.find("model")
    if found is None:
        raise SceneError([f"SDF include {name!r}: the file has no <model>. Give the file of a model"])
    model = copy.deepcopy(found)
    model.set("name", text_of(include.find("name")) or model.get("name", ""))
    for tag in ("pose", "static", "placement_frame"):
        if (own := include.find(tag)) is not None:
            for old in model.findall(tag):
                model.remove(old)
            model.append(own)
            if tag == "placement_frame":
                model.set("placement_frame", text_of(own))
    model.extend(include.findall("plugin"))
    return model


def _merged(model: Element, name: str) -> list[Element]:
    """The parts of a model that is merged into the model that includes it; its own frame becomes a frame of that model."""
    if model.get("placement_frame"):
        raise SceneError([f"SDF include {name!r} is merged by a placement_frame. Include it without merge"])
    parts = [child for child in model if child.tag not in ("pose", "static")]
    pose = model.find("pose")
    if pose is None:
        return parts
    frame = Element("frame", {"name": f"_merged__{model.get('name', '')}__model__"})
    frame.append(pose)
    for part in parts:
        if part.tag in ("link", "model", "frame") and not part.get("attached_to") and part.find("pose") is None:
            part.append(Element("pose"))
        own = part.find("pose")
        for each in part.iter("pose"):
            by_default = each is own and part.tag != "joint" and not part.get("attached_to")
            if each.get("relative_to", "__model__" if by_default else "") == "__model__":
                each.set("relative_to", frame.get("name", ""))
    return [frame, *parts]
