# SPDX-License-Identifier: Apache-2.0
"""Terms and events whose numbers a file may hold, which an extension reads."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from lgvi_warp.common import extensions
from lgvi_warp.common.errors import Faults, SceneError, refusal


class InFile:
    """A term or an event that is also made of a file. The extension's words are its type."""

    type: ClassVar[str]
    # Keys of a table with the key `file`, in a scene file, beside those of `of_file`; the method that reads the file.
    of_file_besides: ClassVar[tuple[str, ...]]
    of_file_by: ClassVar[str]

    @classmethod
    def of_file(cls) -> Any:
        """Return the class whose fields a table with the key `file` may have; None without the extension that reads it."""
        return extensions.load("requests", cls.type)

    @classmethod
    def of_table(cls, where: str, table: Mapping[str, Any]) -> Self:
        """Read the file that a table of a scene file names.

        Args:
            where: The table's place in the scene.
            table: The key `file`, and those of the method besides that reads it.

        Returns:
            The term or event.

        Raises:
            SceneError: As that method.
        """
        fields = dataclasses.fields(_known(cls.of_file(), cls.type))
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

    @classmethod
    def _read_file(cls, source: Any, wanted: Mapping[str, Any], **others: Any) -> Any:
        """Numbers of a file or a data set, as the extension reads them."""
        request = _known(cls.of_file(), cls.type)(**wanted)
        return _known(extensions.load("readers", cls.type), cls.type)(source, request, **others)


def _known(found: Any, word: str) -> Any:
    """What an extension has; refuse the file where none has it."""
    if found is None:
        raise refusal("file", word, "is of a kind that no installed extension reads", "install lgvi-warp anew")
    return found
