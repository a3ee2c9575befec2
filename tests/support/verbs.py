# SPDX-License-Identifier: Apache-2.0
"""Verbs of the command with parts that stand for studies, runs and pictures: what reaches them, and what becomes of it."""

from functools import partial

from lgvi_warp import cli
from lgvi_warp.cli import command


class Study:
    """Stands for the function of a study: keeps what it is called with.

    Args:
        result: What it returns; an error is raised; of a list, one after another.
    """

    def __init__(self, result):
        self.result, self.calls = result, []

    def __call__(self, *values, **settings):
        self.calls.append((values, settings))
        result = self.result[len(self.calls) - 1] if isinstance(self.result, list) else self.result
        if isinstance(result, BaseException):
            raise result
        return result


def main(arguments, **parts):
    """The exit code of the command whose verb calls these parts in place of the package's functions."""
    name = arguments[0]
    verb = command.VERBS[name]
    return cli.main(arguments, verbs={name: partial(getattr(verb, "call", verb), **parts)})
