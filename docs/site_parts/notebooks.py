# SPDX-License-Identifier: Apache-2.0
"""Execute the notebooks and store their outputs: `make notebooks`, or `make notebooks ONLY="ocean margins"`.

With `--compare`, execute them anew and print the cells whose stored outputs differ: `make docs` does so. A notebook carries
the hash of its code, so that outputs of other code are found without executing it.
"""

from __future__ import annotations

import base64
import hashlib
import io
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
from nbclient import NotebookClient

BOOKS = Path(__file__).parents[1] / "notebooks"
# The most bytes of a notebook, colours of a picture, and seconds of a cell.
MOST, COLOURS, TIMEOUT = 150_000, 64, 600
# A cell with this tag shows measured times, or what follows from them: its outputs are compared by their kinds alone.
MEASURED = "measured"
# Smaller numbers are errors of rounding, which differ between processors.
ROUNDING = 1e-7
# Pictures are compared in blocks of so many columns and rows; grey of a block may differ by so much of 255.
BLOCKS, GREY = (40, 30), 20.0
SIZE = 0.02  # relative difference of widths and heights
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:,\d{3})*(?:\.\d*)?(?:[eE][-+]?\d+)?")
UUID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}")


def code_of(book: Any) -> str:
    """The hash of the code of a notebook."""
    code = [cell.source for cell in book.cells if cell.cell_type == "code"]
    return hashlib.sha256("\0".join(code).encode()).hexdigest()


def small(png: str) -> str:
    """A picture in base64 with few colours."""
    from PIL import Image

    with Image.open(io.BytesIO(base64.b64decode(png))) as picture:
        drawn = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    file = io.BytesIO()
    drawn.save(file, "png", optimize=True)
    return base64.b64encode(file.getvalue()).decode()


def joined(outputs: list[Any]) -> list[Any]:
    """Put together what a cell prints piece by piece: where a piece ends is chance. Show stderr here, and do not keep it."""
    found: list[Any] = []
    for output in outputs:
        if output.get("name") == "stderr":
            print(output.text, end="", file=sys.stderr)
            continue
        if found and output.output_type == found[-1].output_type == "stream" and output.name == found[-1].name:
            found[-1].text += output.text
        else:
            found.append(output)
    return found


def clean(book: Any) -> Any:
    """Leave out of an executed notebook what depends on the machine and the day; make its pictures small."""
    book.metadata = nbformat.from_dict({
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
        "lgvi_warp": {"code": code_of(book)},
    })  # fmt: skip
    names: dict[str, str] = {}
    for cell in book.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = joined(cell.outputs)
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = small(data["image/png"])
            if "text/html" in data:
                for name in UUID.findall(data["text/html"]):
                    data["text/html"] = data["text/html"].replace(name, names.setdefault(name, f"id-{len(names)}"))
    return book


def execute(path: Path) -> Any:
    """Execute a notebook in a folder of its own, and leave that folder empty.

    Args:
        path: The notebook.

    Returns:
        The clean notebook with its outputs. An error in a cell is raised.
    """
    book = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        client = NotebookClient(book, timeout=TIMEOUT, kernel_name="python3", resources=resources, record_timing=False)
        client.execute()
        left = [path.name for path in Path(folder).iterdir()]
    if left:
        raise RuntimeError(f"{path.name} leaves files: {left}")
    return clean(book)


def unit(number: str) -> float:
    """One unit of the last digit that a number is printed with: 0.01 for 3.14, 1e-13 for 2.5e-12."""
    mantissa, _, exponent = number.lower().partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def same_text(stored: str, fresh: str) -> bool:
    """Compare two texts: words exactly, numbers to one unit of the last digit of the one that is printed with fewer digits."""
    if NUMBER.sub("#", stored).split() != NUMBER.sub("#", fresh).split():
        return False
    pairs = zip(NUMBER.findall(stored), NUMBER.findall(fresh), strict=True)
    return all(
        abs(float(a.replace(",", "")) - float(b.replace(",", ""))) <= max(1.001 * unit(a), 1.001 * unit(b), ROUNDING)
        for a, b in pairs
    )


def same_picture(stored: str, fresh: str) -> bool:
    """Compare two pictures in base64: their sizes, and the grey of each of 40 x 30 blocks."""
    from PIL import Image

    blocks, sizes = [], []
    for text in (stored, fresh):
        with Image.open(io.BytesIO(base64.b64decode(text))) as picture:
            sizes.append(np.array(picture.size, dtype=float))
            grey = picture.convert("RGB").convert("L").resize(BLOCKS, Image.Resampling.BOX)
            blocks.append(np.asarray(grey, dtype=float))
    if np.any(np.abs(sizes[0] / sizes[1] - 1.0) > SIZE):
        return False
    return bool(np.max(np.abs(blocks[0] - blocks[1])) <= GREY)


def parts(cell: Any) -> list[tuple[str, str]]:
    """(kind, content) of the outputs of a cell."""
    found = []
    for output in cell.outputs:
        if output.output_type == "stream":
            found.append((output.name, output.text))
        found += sorted(output.get("data", {}).items())
    return found


def same_cell(stored: Any, fresh: Any) -> bool:
    """Compare the outputs of a cell with those of a fresh execution; of a table in HTML its plain text is compared."""
    before, after = parts(stored), parts(fresh)
    if [kind for kind, _ in before] != [kind for kind, _ in after]:
        return False
    if MEASURED in stored.metadata.get("tags", ()):
        return True
    compare = {"image/png": same_picture, "text/html": lambda a, b: True}
    return all(compare.get(kind, same_text)(a, b) for (kind, a), (_, b) in zip(before, after, strict=True))


def differing(stored: Any, fresh: Any) -> list[str]:
    """The identifiers of the cells whose outputs differ from those of a fresh execution."""
    pairs = zip(stored.cells, fresh.cells, strict=True)
    return [a.id for a, b in pairs if a.cell_type == "code" and not same_cell(a, b)]


def store(path: Path, fresh: Any) -> None:
    """Write an executed notebook. A cell whose outputs are as before keeps them, so that its text in git does not change."""
    stored = nbformat.read(path, as_version=4)
    for before, after in zip(stored.cells, fresh.cells, strict=True):
        if before.cell_type == "code" and before.outputs and same_cell(before, after):
            after.outputs = before.outputs
    nbformat.write(fresh, path)


def main(words: list[str]) -> int:
    """Execute notebooks, all or those whose names are given, and store or compare their outputs.

    Args:
        words: Names without suffix, and "--compare".

    Returns:
        The number of notebooks whose outputs differ.
    """
    names = [word for word in words if word != "--compare"]
    faults = 0
    for path in sorted(BOOKS.glob("*.ipynb")):
        if names and path.stem not in names:
            continue
        fresh = execute(path)
        changed = differing(nbformat.read(path, as_version=4), fresh)
        if "--compare" not in words:
            store(path, fresh)
            print(f"{path.stem}: {path.stat().st_size / 1e3:.0f} kB, {len(changed)} cells changed", flush=True)
        elif changed:
            faults += 1
            print(f"{path.stem}: outputs differ in {', '.join(changed)}; run `make notebooks ONLY={path.stem}`")
    return faults


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
