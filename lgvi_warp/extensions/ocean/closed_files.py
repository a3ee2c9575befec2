# SPDX-License-Identifier: Apache-2.0
"""Check that an HDF5 file is self-contained: it must not refer to other files or programs, or need unbounded memory."""

from __future__ import annotations

import math
from typing import Any

# Groups and variables of a file; bytes of an axis, which is read whole, and of a chunk, which is unpacked whole.
MOST_OBJECTS, MOST_AXIS, MOST_CHUNK = 10_000, 1 << 28, 1 << 30
# Filters of HDF5 itself: deflate, shuffle, fletcher32, szip, nbit, scaleoffset. For others it looks for a library.
FILTERS = range(1, 7)


def leads_elsewhere(file: Any) -> str:
    """Describe the first part of an open h5py File that lies outside the file or is too large; "" if there is none.

    The metadata of every object that a link or an axis of a variable leads to is checked; no data is read.
    """
    from h5py import Dataset, h5a, h5d, h5g, h5l, h5o, h5r, h5t

    seen, waiting = set(), [file.id]
    while waiting:
        found = waiting.pop()
        if (address := h5o.get_info(found).addr) in seen:
            continue
        seen.add(address)
        if len(seen) > MOST_OBJECTS:
            return f"has more than {MOST_OBJECTS:,} groups and variables"
        if isinstance(found, h5d.DatasetID) and (problem := _stored_elsewhere(found)):
            return problem
        for number in range(h5a.get_num_attrs(found)):
            attribute = h5a.open(found, index=number)
            # References of the standard axes: to variables by DIMENSION_LIST, and back by the other, which nobody follows.
            if attribute.get_type().detect_class(h5t.REFERENCE) and attribute.name != b"REFERENCE_LIST":
                if attribute.name != b"DIMENSION_LIST" or not isinstance(found, h5d.DatasetID):
                    return f"has references in {_text(attribute.name)}"
                references = [one for axis in Dataset(found).attrs["DIMENSION_LIST"] for one in axis]
                waiting += [h5r.dereference(one, found) for one in references if one]
        for name in found if isinstance(found, h5g.GroupID) else ():
            kind = found.links.get_info(name).type
            if kind == h5l.TYPE_HARD:
                waiting.append(h5o.open(found, name))
            elif kind != h5l.TYPE_SOFT:  # one that is soft leads to what a hard one leads to
                return f"has a link to another file, {_text(name)}"
    return ""


def _stored_elsewhere(variable: Any) -> str:
    """Describe data of a variable that lie outside the file or are too large; "" if there are none."""
    from h5py import h5d, h5i

    name, stored = _text(h5i.get_name(variable)), variable.get_create_plist()
    if stored.get_layout() == h5d.VIRTUAL:
        return f"takes the numbers of {name} from other files"
    if stored.get_external_count():
        return f"has the numbers of {name} in another file"
    if other := [number for i in range(stored.get_nfilters()) if (number := stored.get_filter(i)[0]) not in FILTERS]:
        return f"has {name} packed by filter {other[0]}, which is none of HDF5's own"
    size = variable.get_type().get_size()
    if stored.get_layout() == h5d.CHUNKED and math.prod(stored.get_chunk()) * size > MOST_CHUNK:
        return f"has {name} in chunks of more than {MOST_CHUNK:,} bytes"
    shape = variable.shape
    return (
        f"has more than {MOST_AXIS:,} bytes in {name}" if len(shape) < 2 and math.prod(shape) * size > MOST_AXIS else ""
    )


def _text(name: bytes | None) -> str:
    """A name as text."""
    return repr((name or b"?").decode("utf-8", "backslashreplace"))
