# SPDX-License-Identifier: Apache-2.0
"""Terms and events whose numbers can come from a file, which an extension reads."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from lgvi_warp.common.arguments import explained
from lgvi_warp.common.errors import Faults, SceneError


@explained
class InFile:
    """Base class of terms and events that can be read from a file. Their `type` selects the extension's reader."""

    type: ClassVar[str]
    # Keys of a table with the key `file`, in a scene file, beside those of `of_file`; the method that reads the file.
    of_file_besides: ClassVar[tuple[str, ...]]
    of_file_by: ClassVar[str]

    @classmethod
    def of_file(cls) -> Any:
        """Return the class that defines the keys of a table with a `file`; None if no extension reads such a file."""
        return _held("requests", cls.type)

    @classmethod
    def of_table(cls, where: str, table: Mapping[str, Any]) -> Self:
        """Read the file that a table of a scene file names.

        Args:
            where: Name of the table in the scene.
            table: The key `file`, and keys for the arguments of the method that reads the file.

        Returns:
            The term or event.

        Raises:
            SceneError: If a key is unknown or missing, or the method that reads the file raises this error.
        """
        fields = dataclasses.fields(_known(cls.of_file()))
        values = {key: value for key, value in table.items() if key != "type"}
        faults = Faults()
        faults.keys(where, values, [*(item.name for item in fields), *cls.of_file_besides])
        if any(
            item.name == "origin" and item.default is dataclasses.MISSING for item in fields if item.name not in values
        ):
            remedy = "give [latitude, longitude] of the origin of the axes [deg]"
            faults.add(f"{where}.origin", "", "is missing", remedy)
        faults.raise_if_any()
        try:
            return getattr(cls, cls.of_file_by)(values.pop("file"), values.pop("origin", None), **values)
        except SceneError as error:
            raise error.prefixed(f"{where}.") from error


def numbers_in(source: Any, kind: type[InFile], wanted: Mapping[str, Any], **others: Any) -> Any:
    """Read the requested numbers of a file or of a data set, by the extension that has a reader."""
    request = _known(kind.of_file())(**wanted)
    return _held("readers", kind.type)(source, request, **others)


def _held(table: str, word: str) -> Any:
    """Return the entry for a word in a table of the extensions; None if no extension has it."""
    from lgvi_warp.common import extensions  # a scene without a file does not load it

    return extensions.load(table, word)


def _known(request: Any) -> Any:
    """Return the request, or refuse a file that no installed extension reads."""
    if request is None:
        raise SceneError(["file: no installed extension reads such a file. Install lgvi-warp anew."])
    return request
