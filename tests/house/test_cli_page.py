# SPDX-License-Identifier: Apache-2.0
"""The page on the command has every verb with its options, and no other."""

import re
import shlex

import pytest

from lgvi_warp.cli import arguments, parser
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "start" / "cli.md").read_text()
SECTIONS = dict(re.findall(r"^## ([\w -]+)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))
COMMON = SECTIONS.pop("Options of every verb")
VERBS = parser().verbs
OF_EVERY = {name for names in arguments.COMMON for name in names}
# Old names of verbs: their options are those of the new one.
OLD = {"plan": "predict"}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_its_options(verb):
    assert OLD.get(verb, verb) in SECTIONS, f"Write its section, ## {verb}, into docs/start/cli.md"
    section = SECTIONS[OLD.get(verb, verb)]
    assert verb not in OLD or f"`{verb}`" in section
    options = {name for action in VERBS[verb]._actions for name in action.option_strings} - {"-h", "--help"} - OF_EVERY
    # Options stand in backticks, commands of the examples do not.
    shown = set(re.findall(r"`(--[\w-]+)", section))
    # A flag's own --no- stands on the page once, for all of them.
    assert shown == {name for name in options if name.replace("--no-", "--", 1) not in options - {name}}
    words = {action.metavar for action in VERBS[verb]._actions if not action.option_strings}
    assert all(f"`{word}`" in section for word in words if word)


def test_the_options_of_every_verb():
    assert set(re.findall(r"`(--?[\w-]+)", COMMON)) >= OF_EVERY
    for verb in VERBS.values():
        assert {name for action in verb._actions for name in action.option_strings} >= OF_EVERY


def test_no_other_verb_is_there():
    assert set(SECTIONS) == {OLD.get(verb, verb) for verb in VERBS}


def test_every_example_is_understood():
    lines = re.findall(r"^    lgvi-warp (.*?)(?: +#.*)?$", PAGE, re.MULTILINE)
    assert len(lines) >= len(SECTIONS)
    for line in lines:
        verb, *words = shlex.split(line)
        old = {new: old for old, new in OLD.items()}.get(verb, verb)
        known = verb if verb in VERBS else old
        assert parser().parse_args([known, *words]).verb == known


# A command in the text of a page, in a block of it, or for a container.
COMMAND = re.compile(
    r"`(?:docker run lgvi_warp|(?:uvx --from \. )?lgvi-warp) ([^`]*)`|^ *lgvi-warp ([^`\n]*)|run lgvi_warp (.*)$", re.M
)
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / ".ci/Dockerfile"]


def test_commands_of_all_pages_have_known_verbs_and_options():
    found = [(page, "".join(match)) for page in PAGES for match in COMMAND.findall(page.read_text())]
    assert len(found) > 130
    for page, command in found:
        verb, *words = re.split(r"[|>#\\]", command)[0].split()
        if verb != "VERB" and not verb.startswith("-"):
            assert verb in VERBS, f"{page.name}: {command}"
            known = {name for action in VERBS[verb]._actions for name in action.option_strings}
            options = {word.partition("=")[0] for word in words if re.match(r"--\w", word)}
            assert options <= known, f"{page.name}: {command}"
