# SPDX-License-Identifier: Apache-2.0
"""Write what a study found as files for other programs."""

from __future__ import annotations

import json
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common import extensions
from lgvi_warp.common.arguments import explained, path_of
from lgvi_warp.common.errors import among
from lgvi_warp.common.files import write_text
from lgvi_warp.common.reading import corrupt_file_as_scene_error, file_json
from lgvi_warp.common.safe_files import inside
from lgvi_warp.common.tables import write_csv

# Study -> pattern of the names of the files that hold what it found; `study_files` has those of extensions too.
_STUDY_FILES = {
    "tradeoff": "tradeoff.json",
    "sensitivity": "sensitivity.json",
    "stability": "stability*.json",
    "sweep": "sweep.json",
    "rare": "rare.json",
    "derivatives": "derivatives.json",
    "margins": "margins.json",
    "worst_case": "worst_case.json",
    "estimate": "estimate.json",
    "footprint": "footprint.json",
    "tune_gains": "tune_gains.json",
    "trim": "trim.json",
}


def study_files() -> dict[str, str]:
    """Patterns of the names of the files of each study, those of extensions too."""
    return _STUDY_FILES | {word: f"{word}.json" for word in extensions.words("studies")}


def finite_or_none(value: Any) -> Any:
    """Numbers, texts, and dicts, lists and arrays of them with None for what is not finite, as JSON can hold them."""
    if isinstance(value, dict):
        return {key: finite_or_none(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [finite_or_none(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def with_missing_as(value: Any, missing: float) -> Any:
    """Undo `finite_or_none`: a number, infinite or NaN, in place of None."""
    if isinstance(value, dict):
        return {key: with_missing_as(item, missing) for key, item in value.items()}
    if isinstance(value, list):
        return [with_missing_as(item, missing) for item in value]
    return missing if value is None else value


def of_study(path: str | os.PathLike[str]) -> AbstractContextManager[None]:
    """Turn what the content of a study's file raises in the `with` block into a fault of the file."""
    return corrupt_file_as_scene_error(path, "of another version", "run the study again")


@explained
class Saved(ABC):
    """Answer of a study, as content of a JSON file and as records of a CSV file.

    Attributes:
        study: name of the study, and of its files.
        endings: of its files, in the order in which they are written; "txt" is what `str` tells.

    Methods:
        save: Write the files into a folder.
        load: Read the JSON file.
        rows: Records of the CSV file.
        to_csv: Write the CSV file alone.
        to_json: The JSON text.
        to_dict: The content of the JSON file.
        from_dict: Build the answer from this content.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        explained(cls)

    study: ClassVar[str]
    endings: ClassVar[tuple[str, ...]] = ("json", "csv")

    @property
    @abstractmethod
    def answer(self) -> str:
        """The answer in one sentence, in the words of the question; `str` ends with it."""

    def to_dict(self) -> dict[str, Any]:
        """Convert it to plain types for JSON.

        Returns:
            The answer in one sentence, and the content; numbers that are not finite are None.
        """
        return {"answer": self.answer} | self._content()

    @abstractmethod
    def _content(self) -> dict[str, Any]:
        """Content of the JSON file but for the answer."""

    def _report(self) -> Iterable[str]:
        """Lines of text above the answer; none by default."""
        return ()

    def __str__(self) -> str:
        return "\n".join([*self._report(), self.answer])

    @abstractmethod
    def rows(self) -> Iterable[dict[str, Any]]:
        """Flatten it to records.

        Returns:
            One record for each line of the CSV file.
        """

    def to_json(self) -> str:
        """Convert it to a JSON text.

        Returns:
            The text of `to_dict`; numbers that are not finite are null.
        """
        return json.dumps(self.to_dict(), indent=1)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows to a CSV file.

        Args:
            path: of the file.

        Returns:
            Path of the file.

        Raises:
            OSError: if it cannot be written.
        """
        return write_csv(list(self.rows()), path)

    def save(self, folder: str | os.PathLike[str], name: str = "") -> list[Path]:
        """Write a file of each ending, NAME.json and NAME.csv, into a folder, which is made if needed.

        Args:
            folder: of the files.
            name: their name without the ending. Default: that of the study, as "tradeoff".

        Returns:
            Paths of the files.

        Raises:
            OSError: if they cannot be written.
        """
        target = path_of("folder", folder)
        name = self.study if among(name, ("",)) else str(path_of("name", name))
        target.mkdir(parents=True, exist_ok=True)
        return [self._write(target / f"{name}.{ending}", target) for ending in self.endings]

    def _write(self, path: Path, root: Path) -> Path:
        if path.suffix == ".csv":
            return write_csv(list(self.rows()), path, root)
        return write_text(path, self.to_json() if path.suffix == ".json" else f"{self}\n", root)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        """Build it from the content of a JSON file.

        Args:
            content: as `to_dict` returns it; the answer follows from the rest.

        Returns:
            What the study found; numbers that were not finite are infinite or NaN.
        """
        return cls._of_content({name: value for name, value in content.items() if name != "answer"})

    @classmethod
    @abstractmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        """Build it from what `_content` returned."""

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read it from the JSON file that `save` wrote.

        Args:
            path: of the file, or of the folder with it.

        Returns:
            What the study found.

        Raises:
            OSError: if the file cannot be read.
            SceneError: if it is no regular file, is damaged, or of another version.
        """
        own = f"{cls.study}.json" if hasattr(cls, "study") else ""
        if own and (folder := path_of("path", path)).is_dir() and folder.name != own:
            path = inside(folder, own)
        with of_study(path):
            found = cls.from_dict(file_json(path))
            list(found.rows()), found.to_json(), str(found)  # what cannot be shown is refused here
            return found
