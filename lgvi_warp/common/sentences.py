# SPDX-License-Identifier: Apache-2.0
"""Sentences of messages: the problem of a key, and the remedy."""

from __future__ import annotations

import re

# First words of a problem that is the predicate of its sentence: the key with its value is the subject.
PREDICATES = frozenset(
    "acts are begin begins belongs cannot changes creates did differs do does draws end ends estimates gave gives goes has "  # noqa: SIM905
    "have holds is keeps leaves lies make maps may moves name names needs passes repeats runs say says scales sets stands "
    "takes varies was weigh were would".split()
)
# A word, no name of the program.
WORD = re.compile(r"[a-z]+(?=[ ,:]|$)")


def sentences(subject: object, problem: str, remedy: str) -> str:
    """Write a problem of a subject with its remedy: "vehicle.mass = -1.0 is not positive. Give a number above 0 [kg]"."""
    colon = "" if problem.partition(" ")[0].rstrip(",") in PREDICATES else ":"
    return f"{subject}{colon} {problem}. {capital(remedy)}"


def capital(text: str) -> str:
    """Begin a text with a capital letter, unless it begins with a name of the program, such as save=... or lw.solve."""
    return text[:1].upper() + text[1:] if WORD.match(text) else text


def with_stop(text: str) -> str:
    """End a text with a full stop, unless it ends with a command or a quoted name, which users copy."""
    return text if text.endswith((".", "?", "!", "'", '"', "`")) else f"{text}."
