# SPDX-License-Identifier: Apache-2.0
"""Verbs that call a function of the package: options, types and help come from its signature and its docstring.

Both are read from the source, so that no library is loaded before a verb runs. An omitted option is not passed to the
function, so the signature alone defines the defaults.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import functools
import importlib
import inspect
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lgvi_warp.cli import documents
from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.report import file_line
from lgvi_warp.cli.settings import folder, load_scene
from lgvi_warp.cli.verb import FOLDER, SHARED, Verb, add_shared, without
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.arguments import alternatives
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.reading import file_text

PACKAGE = Path(__file__).parents[1]
# Arguments of functions that are keys of a scene's [run] -> their options.
RUN = {"t1": "duration", "method": "method", "h": "step", "dtype": "dtype"}
ENTRY = re.compile(r"^    (\w+): (.*(?:\n {8}.*)*)", re.MULTILINE)
# A comma outside of brackets.
COMMA = re.compile(r",(?![^(\[]*[)\]])")


class Form(NamedTuple):
    """Form of an option's text; `read` raises ValueError; values of a repeated option are joined."""

    metavar: str
    read: Callable[[str], Any]
    problem: str = ""
    remedy: str = ""
    many: bool = False


def whole(text: str) -> int:
    """Read a whole number, also as 1e6. Raises ValueError."""
    number = float(text)
    if not number.is_integer():
        raise ValueError(text)
    return int(text) if text.strip().lstrip("+-").isdigit() else int(number)


def value(text: str) -> Any:
    """Read a number, true, false or none; anything else is a text."""
    with contextlib.suppress(ValueError):
        return float(text)
    return {"true": True, "false": False, "none": None}.get(text.strip().lower(), text)


def bounds(text: str) -> Any:
    """Read LOW:HIGH or LOW:HIGH:log as a tuple; anything else as by `value`."""
    ends = tuple(value(end) for end in text.split(":"))
    return ends if len(ends) > 1 and isinstance(ends[0], float) else value(text)


def names(text: str) -> list[str]:
    """Split names at commas that are not within brackets."""
    return [name.strip() for name in COMMA.split(text)]


def pairs(text: str, read: Callable[[str], Any] = bounds, several: bool = True) -> dict[str, Any]:
    """Read NAME=VALUE, or several of them between commas, as a dict. Raises ValueError."""
    table = {}
    for pair in COMMA.split(text) if several else [text]:
        name, _, content = (word.strip() for word in pair.partition("="))
        if not name or not content:
            raise ValueError(pair)
        table[name] = read(content)
    return table


NUMBER = Form("X", float, "is not a number", "give one, as 0.5")
WHOLE = Form("N", whole, "is not a whole number", "give one, as 24")
COUNTS = Form("N", lambda text: tuple(map(whole, text.split(","))) if "," in text else whole(text), *WHOLE[2:4])
TEXT = Form("TEXT", str)
FLAG = Form("", bool)
GROUPS = Form("NAME=A,B", functools.partial(pairs, read=names, several=False), "names nothing",
              "give NAME=A,B", True)  # fmt: skip
NUMBERS = Form("NAME=X", functools.partial(pairs, read=float), "is not a value", "give NAME=0.1", True)
VALUES = Form("NAME=VALUE", pairs, "names no value", "give NAME=LOW:HIGH, or NAME=LOW:HIGH:log", True)
# First word of an annotation -> form.
FORMS = {
    "bool": FLAG, "float": NUMBER, "int": WHOLE, "str": TEXT, "OfInterest": TEXT, "Any": Form("VALUE", value),
    "Mapping[str, Sequence[str]]": GROUPS, "Mapping[str, float]": NUMBERS, "Mapping[str, Any]": VALUES,
    "Sequence[str]": Form("A,B", names, many=True),
    "Sequence[OfInterest]": Form("TEXT", lambda text: [text], many=True),
    "Sequence[Mapping[str, Any]]": VALUES._replace(metavar="A=X,B=Y", read=lambda text: [pairs(text)],
                                                   remedy="give A=X,B=Y"),
}  # fmt: skip


def form_of(kind: str) -> Form | None:
    """Choose the form for an annotation; None if no text of a command can express it."""
    kinds = [word.strip() for word in alternatives(kind)]
    lists = [word.replace(" | Scene", "") for word in kinds if word.startswith("Sequence")]
    form = COUNTS if "tuple[int, int]" in kinds else FORMS.get((lists or kinds)[0])
    if form is None or form.many or "None" not in kinds:
        return form
    return form._replace(read=lambda text: None if text.strip().lower() == "none" else form.read(text))


@dataclass(frozen=True)
class Argument:
    """An argument of a function: its annotation, its text in the docstring, and whether it has no default."""

    name: str
    kind: str
    text: str
    required: bool

    @property
    def dest(self) -> str:
        """Name of the argument's option in the parsed arguments."""
        return RUN.get(self.name, self.name)

    @property
    def option(self) -> str:
        """The argument's option."""
        return f"--{self.dest.replace('_', '-')}"

    def add(self, parser: Any, only: str, form: Form) -> None:
        """Add the option of the argument to a parser; only: text that names the only function with this argument."""
        if self.name in RUN:
            add_shared(parser, self.option)
            return
        # What only points to another function is said here.
        text = SHARED[self.option]["help"] if re.match("[Aa]s of", self.text) else self.text
        ways = [form.remedy] * (form.metavar not in "NX") + ["may be given several times"] * form.many
        text = "; ".join([re.sub(r"(?<!\.)\.$", "", text), *filter(None, ways)]) if any(ways) else text
        settings: dict[str, Any] = {"help": only + text.replace("%", "%%"), "required": self.required}
        if form is FLAG:
            parser.add_argument(self.option, action=argparse.BooleanOptionalAction, **settings)
        else:
            parser.add_argument(
                self.option, metavar=form.metavar, action="append" if form.many else "store", **settings
            )


@functools.cache
def described(place: str) -> tuple[str, dict[str, Argument]]:
    """Read the first sentence of a function, MODULE:NAME, and its arguments that can be options, except the first."""
    module, _, name = place.partition(":")
    source = file_text(PACKAGE.joinpath(*module.split(".")).with_suffix(".py"), "module")
    (text,) = re.findall(rf"(?ms)^def {name}\(.*?(?=^[\w@#]|\Z)", source)
    node: Any = ast.parse(text).body[0]
    document = ast.get_docstring(node) or ""
    texts = {key: " ".join(entry.split()) for key, entry in ENTRY.findall(document)}
    plain, keyed = node.args.args, node.args.kwonlyargs
    defaults = [*[None] * (len(plain) - len(node.args.defaults)), *node.args.defaults, *node.args.kw_defaults]
    arguments = {
        each.arg: Argument(each.arg, ast.unparse(each.annotation), texts[each.arg], default is None)
        for each, default in zip([*plain, *keyed], defaults, strict=True)
    }
    if node.args.kwarg is not None:
        further = dict.fromkeys(RUN, "str") | {"threads": "int"}
        arguments |= {
            key: Argument(key, kind, "As of solve", False) for key, kind in further.items() if key not in arguments
        }
    known = {key: each for key, each in arguments.items() if form_of(each.kind) and key != plain[0].arg}
    return document.partition(".\n")[0].rstrip("."), known


@dataclass(frozen=True)
class FunctionOptions:
    """Options of a verb that calls a function of the package, MODULE:NAME, or one of several functions by --analysis.

    Attributes:
        shared: options of the scene in addition to the functions' arguments.
        forms: forms of the arguments with a special syntax.
        only: names of the arguments that are options; default all.
    """

    places: tuple[str, ...]
    shared: str = "--set"
    forms: Mapping[str, Form] = field(default_factory=dict)
    only: tuple[str, ...] | None = None

    @property
    def sentence(self) -> str:
        """First sentence of the function, for the list of verbs."""
        text, _ = described(self.places[0])
        return text[0].lower() + text[1:]

    @property
    def functions(self) -> dict[str, dict[str, Argument]]:
        """Arguments that are options, by name of the function."""
        return {
            place.partition(":")[2]: {name: each for name, each in described(place)[1].items()
                                      if self.only is None or name in self.only}
            for place in self.places
        }  # fmt: skip

    def form(self, argument: Argument) -> Form:
        """Choose the form of an argument."""
        return self.forms.get(argument.name) or form_of(argument.kind) or TEXT

    def add(self, parser: Any) -> None:
        """Add the options to a parser, the required ones first."""
        functions = self.functions
        if len(functions) > 1:
            first = next(iter(functions))
            helps = "; ".join(f"{place.partition(':')[2]}: {described(place)[0]}" for place in self.places)
            parser.add_argument("--analysis", choices=functions, default=first, help=f"{helps} (default {first})")
        every = {name: each for arguments in reversed(functions.values()) for name, each in arguments.items()}
        for name, each in sorted(every.items(), key=lambda item: (not item[1].required, item[0] in RUN)):
            having = [key for key, arguments in functions.items() if name in arguments]
            only = f"{having[0]}: " if len(having) < len(functions) else ""
            each.add(parser, only, self.form(each))
        add_shared(parser, self.shared)

    def values_of(self, chosen: argparse.Namespace, function: str) -> dict[str, Any]:
        """Take the arguments of a function from its options and remove them from the parsed ones. Raises SceneError."""
        faults, values = Faults(), {}
        arguments = self.functions
        for other in arguments:
            for name in arguments[other].keys() - arguments[function].keys():
                if getattr(chosen, name) is not None:
                    faults.add(
                        arguments[other][name].option, getattr(chosen, name), f"is an option of {other}", "leave it out"
                    )
        for name, each in arguments[function].items():
            if (words := getattr(chosen, each.dest)) is None or name in RUN:
                continue
            setattr(chosen, each.dest, None)  # of the function, and not of the scene's file
            form, parts = self.form(each), []
            for word in words if isinstance(words, list) else [words]:
                with faults.including():
                    try:
                        parts.append(form.read(word))
                    except ValueError as error:
                        if isinstance(error, SceneError):
                            raise
                        faults.add(each.option, word, form.problem, form.remedy)
            if parts:
                values[name] = functools.reduce(operator.or_ if isinstance(parts[0], dict) else operator.add, parts)
        faults.raise_if_any()
        return values

    def call_of(self, chosen: argparse.Namespace) -> tuple[Any, Callable[..., Any], dict[str, Any]]:
        """Make (the scene, the function, the arguments given by options)."""
        function = getattr(chosen, "analysis", None) or next(iter(self.functions))
        values = self.values_of(chosen, function)
        scene = load_scene(chosen)
        for name in RUN.keys() & self.functions[function].keys():
            if getattr(chosen, RUN[name]) is not None:
                values[name] = getattr(scene.run, RUN[name])
        module = next(place for place in self.places if place.endswith(f":{function}")).partition(":")[0]
        return scene, getattr(importlib.import_module(f"lgvi_warp.{module}"), function), values


def as_study(
    name: str, *places: str, help: str = "", shared: str = "--set", forms: Mapping[str, Form] | None = None,
    more: Callable[[Any], None] = without, about: Callable[[argparse.Namespace, Any, dict[str, Any]], Any] | None = None,
    picture: bool = False, always: bool = True, above: Callable[[argparse.Namespace, Any, Path | None], str] | None = None,
    faults: Callable[[Any], list[str]] | None = None,
) -> Verb:  # fmt: skip
    """Make a verb that calls a function and writes the files of its answer.

    help: Text instead of the function's first sentence. more: function that adds options. about: function of the parsed
    arguments, the scene and the function's arguments that returns the function's first argument, or raises an error.
    picture: whether the answer has a picture of the verb's name. always: whether files are written also without --out.
    above: function that returns text to print above the answer. faults: function that lists faults of an answer.
    """
    options = FunctionOptions(places, shared, forms or {})
    stem = name.replace("-", "_")

    def arguments(parser: Any) -> None:
        default = FOLDER.format(f"runs/NAME_{stem}") if always else FOLDER.format("no files are written")
        add_shared(parser, "scene --out", out=default)
        options.add(parser)
        more(parser)

    def call(chosen: argparse.Namespace, *, study: Part = None, draw: Part = None) -> int:
        scene, function, values = options.call_of(chosen)
        fleet = about(chosen, scene, values) if about else scene
        out = folder(chosen, f"_{stem}") if always or chosen.out else None
        from lgvi_warp.calls.prepared import FailedMembers

        watched = "progress" in inspect.signature(function).parameters
        try:
            with progress_bar(chosen.quiet, "compiling" if watched else "running") as progress:
                # None would show some of them on a terminal, quiet or not.
                shown = {"progress": progress or False} if watched else {}
                answer = (study or function)(fleet, **values, **shown)
        except FailedMembers as error:
            return len(print_faults([str(error)]))
        text = f"{above(chosen, answer, out)}\n{answer}" if above else str(answer)
        if out is None:
            tell(chosen, answer.to_dict, lambda: text)
            return 0
        with progress_bar(chosen.quiet, "writing"):
            written = Written(answer.save(out))
            if picture:
                from lgvi_warp import plots

                written.draw(draw or getattr(plots, stem), answer, out / f"{stem}.png")
        code = finish(written, chosen, {stem: answer.to_dict()}, text)
        return 1 if faults and print_faults(faults(answer)) else code

    return Verb(call, name, help or options.sentence, arguments, not always, ())


def finish(written: Written, chosen: argparse.Namespace, content: Mapping[str, Any], text: str) -> int:
    """Print a study's notes, files and report, whose last line is the answer, and report what failed."""
    tell(
        chosen,
        lambda: {"content": content} | documents.of_files(written),
        lambda: "\n".join([*written.note_lines(), *map(file_line, written.files), "", text.rstrip()]),
    )
    print_faults(written.empty)
    return 1 if print_faults(written.faults) else 0
