# SPDX-License-Identifier: Apache-2.0
"""The verb completion: what completes the command in bash, zsh and fish, made of its parser."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any, NamedTuple

from lgvi_warp.cli.output import tell
from lgvi_warp.cli.verb import COMMON, as_verb
from lgvi_warp.common.status import CHECKS, ON_FAILURE


class CompletedVerb(NamedTuple):
    """A verb and the words that may follow it.

    options: Option -> (its help, words that may be its value; none for a file, None for an option without a value).
    """

    name: str
    text: str
    options: dict[str, tuple[str, tuple[str, ...] | None]]
    words: tuple[str, ...]


def values() -> dict[str, tuple[str, ...]]:
    """List the values of options that are checked with the scene and not by the parser."""
    from lgvi_warp.common.machine import DTYPES
    from lgvi_warp.engine.executors import NAMES
    from lgvi_warp.methods import method
    from lgvi_warp.physics.fields import TABLE
    from lgvi_warp.scene.settings import DEVICES, KEEP
    from lgvi_warp.store.export import FORMATS
    from lgvi_warp.vehicles.fossen import vehicle_names

    # Compositions stand without the method that they are of: parentheses mean something to shells.
    methods = (*method.PROGRAMS, *method.TWO_PART, *method.GAUSS, *method.RUNGE_KUTTA, *method.COMPOSITIONS,
               *method.HALVES)  # fmt: skip
    return {
        "--method": methods, "--methods": methods, "--dtype": tuple(DTYPES), "--dtypes": tuple(DTYPES),
        "--store-dtype": ("float32", "float64"), "--solver": method.SOLVERS, "--iterations": ("auto",), "--checks": CHECKS,
        "--on-failure": ON_FAILURE, "--keep": KEEP, "--device": DEVICES, "--executor": NAMES, "--of": tuple(TABLE),
        "--to": tuple(FORMATS), "--vehicle": tuple(vehicle_names()),
    }  # fmt: skip


BASH = """_lgvi_warp() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} verb="" each
    # Readline takes "--option=value" for three words.
    [[ $before == "=" ]] && before=${{COMP_WORDS[COMP_CWORD-2]}}
    [[ $word == "=" ]] && word=""
    for each in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        [[ " {known} " == *" $each "* ]] && {{ verb=$each; break; }}
    done
    local words="" files=""
    case "$verb $before" in
{values}
        *) case "$verb" in
{verbs}
            *) words="{names}" ;;
        esac ;;
    esac
    [[ $word == *,* && $before == --methods ]] && words=$(printf "${{word%,*}},%s " $words)
    COMPREPLY=($(compgen -W "$words" -- "$word"))
    local IFS=$'\n'
    [[ -n $files && $word != -* ]] && COMPREPLY+=($(compgen -f -- "$word"))
}}
complete -o filenames -F _lgvi_warp lgvi-warp
"""

ZSH = """#compdef lgvi-warp
_lgvi_warp() {{
    local -a verbs
    verbs=(
{names}
    )
    if (( CURRENT == 2 )); then
        _describe verb verbs
        return
    fi
    case $words[2] in
{verbs}
    esac
}}
(( $+functions[compdef] )) && compdef _lgvi_warp lgvi-warp
"""


def completion_arguments(verb: Any) -> None:
    """Add the arguments of the verb completion."""
    verb.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")


@as_verb("completion", "print what completes the command in a shell", completion_arguments, reads=True)
def completion(chosen: argparse.Namespace) -> int:
    """Run the verb completion: print a script for a shell."""
    chosen.quiet = False
    text = {"bash": bash, "zsh": zsh, "fish": fish}[chosen.shell](list(verbs(chosen.parser)))
    tell(chosen, lambda: {"shell": chosen.shell, "script": text}, text.rstrip)
    return 0


def verbs(parser: Any) -> Iterator[CompletedVerb]:
    """Read the verbs from the parser of the command."""
    known = values()
    for name, verb in parser.verbs.items():
        options: dict[str, tuple[str, tuple[str, ...] | None]] = {}
        words: tuple[str, ...] = ()
        for action in verb._actions:
            choices = tuple(map(str, action.choices or ()))
            for option in action.option_strings:
                words_of = choices or known.get(option, ())
                options[option] = (action.help or "", None if action.nargs == 0 else words_of)
            words = words if action.option_strings else words + choices
        yield CompletedVerb(name, verb.description or "", options, words)


def bash(known: list[CompletedVerb]) -> str:
    """Write the script for bash."""
    lines = [f'        "{verb.name} {option}") words="{" ".join(words)}" ;;' for verb in known
              for option, (_, words) in verb.options.items() if words]  # fmt: skip
    lists = [f'            {verb.name}) words="{" ".join([*verb.words, *verb.options])}"{"" if verb.words else " files=1"} ;;'
             for verb in known]  # fmt: skip
    # Options of every verb may stand before it.
    common = [option for options in COMMON for option in options]
    lines += [f'        " {option}") words="{" ".join(settings["choices"])}" ;;' for options, settings in COMMON.items()
               for option in options if "choices" in settings]  # fmt: skip
    verbs_alone = " ".join(verb.name for verb in known)
    names = " ".join([verbs_alone, "--help", "--version", *common])
    return BASH.format(values="\n".join(lines), verbs="\n".join(lists), names=names, known=verbs_alone)


def zsh(known: list[CompletedVerb]) -> str:
    """Write the script for zsh."""
    names = "\n".join(f"        {_quoted(f'{verb.name}:{verb.text}')}" for verb in known)
    lists = []
    for verb in known:
        lines = [_quoted(f"*{option}[{_plain(text)}]{_value(words)}") for option, (text, words) in verb.options.items()]
        lines.append(_quoted(f"*:word:({' '.join(verb.words)})") if verb.words else "'*:file:_files'")
        lists.append(f"        {verb.name}) _arguments -s {' '.join(lines)} ;;")
    return ZSH.format(names=names, verbs="\n".join(lists))


def fish(known: list[CompletedVerb]) -> str:
    """Write the script for fish."""
    head = "complete -c lgvi-warp -n __fish_use_subcommand -f -a"
    lines = [f"{head} {verb.name} -d {_quoted(verb.text)}" for verb in known]
    for verb in known:
        head = f"complete -c lgvi-warp -n '__fish_seen_subcommand_from {verb.name}'"
        if verb.words:
            lines.append(f"{head} -f -a {_quoted(' '.join(verb.words))}")
        for option, (text, words) in verb.options.items():
            flag = f"-l {option[2:]}" if option.startswith("--") else f"-s {option[1:]}"
            value = "" if words is None else f" -x -a {_quoted(' '.join(words))}" if words else " -r"
            lines.append(f"{head} {flag}{value} -d {_quoted(text)}")
    return "\n".join(lines) + "\n"


def _value(words: tuple[str, ...] | None) -> str:
    """The value of an option, as zsh writes it."""
    return "" if words is None else f":value:({' '.join(words)})" if words else ":value:_files"


def _plain(text: str) -> str:
    """A text without what zsh reads as structure."""
    return text.translate(str.maketrans("[]:", "();"))


def _quoted(text: str) -> str:
    """A text as one word of a shell."""
    return "'" + text.replace("'", "'\\''") + "'"
