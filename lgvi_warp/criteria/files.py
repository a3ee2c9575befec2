# SPDX-License-Identifier: Apache-2.0
"""Write the results of a study to files for other programs."""

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
    """Patterns of each study's file names, including the studies of extensions."""
    return _STUDY_FILES | {word: f"{word}.json" for word in extensions.words("studies")}


def finite_or_none(value: Any) -> Any:
    """Convert numbers, texts, dicts, lists and arrays to JSON types; numbers that are not finite become None."""
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
    """Undo `finite_or_none`: replace None by `missing`, which is infinite or NaN."""
    if isinstance(value, dict):
        return {key: with_missing_as(item, missing) for key, item in value.items()}
    if isinstance(value, list):
        return [with_missing_as(item, missing) for item in value]
    return missing if value is None else value


def of_study(path: str | os.PathLike[str]) -> AbstractContextManager[None]:
    """Turn exceptions that a study file's content raises in the `with` block into a SceneError about the file."""
    return corrupt_file_as_scene_error(path, "of another version", "run the study again")


@explained
class Saved(ABC):
    """Base class of the answers of studies, which are written to JSON, CSV and other files.

    Attributes:
        study: name of the study, and of its files.
        endings: endings of the names of its files, in the order of writing. The "txt" file has the text of `str`.

    Methods:
        save: Write the files into a folder.
        load: Read the answer from the JSON file.
        rows: List the records of the CSV file.
        to_csv: Write only the CSV file.
        to_json: Convert the answer to a JSON text.
        to_dict: Convert the answer to a dict with the content of the JSON file.
        from_dict: Build the answer from such a dict.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        explained(cls)

    study: ClassVar[str]
    endings: ClassVar[tuple[str, ...]] = ("json", "csv")

    @property
    @abstractmethod
    def answer(self) -> str:
        """The answer in one sentence, which repeats the question. The text of `str` ends with this sentence."""

    def to_dict(self) -> dict[str, Any]:
        """Convert the answer to plain types for JSON.

        Returns:
            A dict with the fields of the answer, and the answer in one sentence. Numbers that are not finite are None.
        """
        return {"answer": self.answer} | self._content()

    @abstractmethod
    def _content(self) -> dict[str, Any]:
        """Content of the JSON file without the sentence of the answer."""

    def _report(self) -> Iterable[str]:
        """Lines of text above the answer's sentence; none by default."""
        return ()

    def __str__(self) -> str:
        return "\n".join([*self._report(), self.answer])

    @abstractmethod
    def rows(self) -> Iterable[dict[str, Any]]:
        """Flatten the answer to records.

        Returns:
            One record for each line of the CSV file.
        """

    def to_json(self) -> str:
        """Convert the answer to a JSON text.

        Returns:
            The dict of `to_dict` as JSON. Numbers that are not finite are null.
        """
        return json.dumps(self.to_dict(), indent=1)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows to a CSV file.

        Args:
            path: path of the file.

        Returns:
            Path of the file.

        Raises:
            OSError: if the file cannot be written.
        """
        return write_csv(list(self.rows()), path)

    def save(self, folder: str | os.PathLike[str], name: str = "") -> list[Path]:
        """Write one file for each ending, such as NAME.json and NAME.csv, into a folder, which is created if needed.

        Args:
            folder: path of the folder.
            name: file name without its ending. Default: name of the study, such as "tradeoff".

        Returns:
            Paths of the files.

        Raises:
            OSError: if the files cannot be written.
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
        """Build the answer from the content of a JSON file.

        Args:
            content: dict as returned by `to_dict`. Its answer in one sentence is not read, but derived again.

        Returns:
            The answer of the study. A number that is None in the dict becomes infinite or NaN, depending on the field.
        """
        return cls._of_content({name: value for name, value in content.items() if name != "answer"})

    @classmethod
    @abstractmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        """Build the answer from the dict that `_content` returned."""

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read the answer from the JSON file that `save` wrote.

        Args:
            path: path of the JSON file, or of the folder into which `save` wrote it.

        Returns:
            The answer of the study.

        Raises:
            OSError: if the file cannot be read.
            SceneError: if the file is not a regular file, is damaged, or was written by another version.
        """
        own = f"{cls.study}.json" if hasattr(cls, "study") else ""
        if own and (folder := path_of("path", path)).is_dir() and folder.name != own:
            path = inside(folder, own)
        with of_study(path):
            found = cls.from_dict(file_json(path))
            list(found.rows()), found.to_json(), str(found)  # what cannot be shown is refused here
            return found
