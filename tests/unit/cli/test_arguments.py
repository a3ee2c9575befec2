# SPDX-License-Identifier: Apache-2.0
"""The help of the command and what it does where an option is left out."""

import re

import pytest

from lgvi_warp.cli.arguments import parser


def options():
    """(verb, option, default, the default that its help tells) of each option whose help tells one."""
    for verb, one in parser().verbs.items():
        for action in one._actions:
            told = re.search(r"\(default:? ([\w.]+)\)", action.help or "")
            if told and action.default is not None:
                yield verb, action.option_strings[-1], action.default, told[1]


OPTIONS = list(options())


@pytest.mark.parametrize(
    ("verb", "option", "default", "reported"), OPTIONS, ids=[f"{verb} {name}" for verb, name, *_ in OPTIONS]
)
def test_a_default_is_what_the_help_says(verb, option, default, reported):
    assert type(default)(reported) == default


def test_there_are_defaults_to_look_at():
    assert {("bench", "--members"), ("sweep", "--record")} <= {(verb, option) for verb, option, *_ in OPTIONS}
