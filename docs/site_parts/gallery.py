# SPDX-License-Identifier: Apache-2.0
"""Run the examples, keep their pictures, and write docs/gallery.md: `make gallery`, or `make gallery ONLY="02 07"`.

A picture carries the hash of the code that drew it and what the script printed: a stale picture is found in any clone.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs"))

from site_parts import movie  # noqa: E402
from site_parts import pictures as kept  # noqa: E402
from site_parts.pictures import made_of_script  # noqa: E402

PICTURES = ROOT / "docs" / "gallery"
PAGE = ROOT / "docs" / "gallery.md"
HEAD = """# Gallery

The gallery has twelve scripts of less than 80 lines, from `examples/01_first_dive.py` on. Each script prints its numbers
and writes its picture into the current folder. Times were measured on two shared cores of an AMD EPYC. Examples of
[controllers](controllers/README.md) are in `examples/controllers/`. Written by `make gallery`; do not edit.
"""


def scripts() -> list[Path]:
    """The examples of the gallery, in order."""
    return sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))


def run(script: Path, folder: Path) -> str:
    """Run an example in a folder.

    Args:
        script: The example.
        folder: Where it writes its picture, named as the script is.

    Returns:
        What it printed.
    """
    command = [sys.executable, str(script)]
    return subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout


def keep(script: Path, folder: Path, printed: str) -> None:
    """Put the picture that an example wrote into docs/gallery, with few colours and with where it comes from.

    Args:
        script: The example.
        folder: Where it ran.
        printed: What it printed.
    """
    drawn = (folder / script.name).with_suffix(".png")
    kept.keep(drawn, PICTURES / f"{script.stem}.png", script=made_of_script(script), printed=printed)


def notes(script: Path) -> dict[str, str]:
    """What the picture of an example says of itself.

    Args:
        script: The example.

    Returns:
        The hash of the code that drew it, "script", and what that printed, "printed".
    """
    return kept.notes(PICTURES / f"{script.stem}.png")


def section(script: Path) -> str:
    """Write the part of the page about one example.

    Args:
        script: The example.

    Returns:
        Markdown: heading, picture, caption, what is printed, and the script.
    """
    code = script.read_text()
    title, _, caption = ast.get_docstring(ast.parse(code)).partition(":")
    printed = "".join(f"    {line}\n" for line in notes(script)["printed"].splitlines())
    return f"""
## {int(script.name[:2])}. {title}

![{title}](gallery/{script.stem}.png)

{caption.strip()[0].upper()}{caption.strip()[1:]}

{printed}
<details><summary><code>examples/{script.name}</code></summary>

```python
{code}```

</details>
"""


def page() -> str:
    """Write the page of all examples, from the scripts and the pictures that are kept."""
    return HEAD + "".join(section(script) for script in scripts())


def main(chosen: list[str]) -> None:
    """Run examples, all or those whose numbers are given, make the moving picture if it is meant, and write the page."""
    PICTURES.mkdir(exist_ok=True)
    for script in scripts():
        if not chosen or script.name[:2] in chosen:
            with tempfile.TemporaryDirectory() as folder:
                keep(script, Path(folder), run(script, Path(folder)))
            print(script.name, flush=True)
    if not chosen or "movie" in chosen:
        movie.main()
    PAGE.write_text(page())


if __name__ == "__main__":
    main(sys.argv[1:])
