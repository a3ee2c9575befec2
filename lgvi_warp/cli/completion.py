# SPDX-License-Identifier: Apache-2.0
"""The verb completion: what completes the command in bash, zsh and fish, made of its parser."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

from lgvi_warp.cli.arguments import parser
from lgvi_warp.cli.output import tell


class Verb(NamedTuple):
    """A verb and the words that may follow it.

    Args:
        name: The verb.
        text: What it does.
        options: Option -> (its help, words that may be its value; none for any, None for an option without a value).
        words: Words that may be its argument; none for files.
    """

    name: str
    text: str
    options: dict[str, tuple[str, tuple[str, ...] | None]]
    words: tuple[str, ...]


BASH = """_lgvi_warp() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} verb="" each
    for each in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        [[ $each != -* ]] && {{ verb=$each; break; }}
    done
    local words="" files=""
    case "$verb $before" in
{values}
        *) case "$verb" in
{verbs}
            *) words="{names}" ;;
        esac ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
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


def completion(chosen: argparse.Namespace) -> int:
    """Run the verb completion: print a script for a shell.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.
    """
    chosen.quiet = False
    text = {"bash": bash, "zsh": zsh, "fish": fish}[chosen.shell](list(verbs()))
    tell(chosen, lambda: {"shell": chosen.shell, "script": text}, text.rstrip)
    return 0


def verbs() -> Iterator[Verb]:
    """Read the verbs from the parser.

    Yields:
        Each verb with its options.
    """
    for name, verb in parser().verbs.items():
        options: dict[str, tuple[str, tuple[str, ...] | None]] = {}
        words: tuple[str, ...] = ()
        for action in verb._actions:
            values = tuple(map(str, action.choices or ()))
            for option in action.option_strings:
                options[option] = (action.help or "", None if action.nargs == 0 else values)
            words = words if action.option_strings else words + values
        yield Verb(name, verb.description or "", options, words)


def bash(known: list[Verb]) -> str:
    """Write the script for bash.

    Args:
        known: The verbs.

    Returns:
        Its text, to be sourced.
    """
    values = [f'        "{verb.name} {option}") words="{" ".join(words)}" ;;' for verb in known
              for option, (_, words) in verb.options.items() if words]  # fmt: skip
    lists = [f'            {verb.name}) words="{" ".join([*verb.words, *verb.options])}"{"" if verb.words else " files=1"} ;;'
             for verb in known]  # fmt: skip
    names = " ".join([*(verb.name for verb in known), "--help", "--version"])
    return BASH.format(values="\n".join(values), verbs="\n".join(lists), names=names)


def zsh(known: list[Verb]) -> str:
    """Write the script for zsh.

    Args:
        known: The verbs.

    Returns:
        Its text, for a file _lgvi-warp in a folder of $fpath.
    """
    names = "\n".join(f"        {_quoted(f'{verb.name}:{verb.text}')}" for verb in known)
    lists = []
    for verb in known:
        lines = [_quoted(f"*{option}[{_plain(text)}]{_value(words)}") for option, (text, words) in verb.options.items()]
        lines.append(_quoted(f"*:word:({' '.join(verb.words)})") if verb.words else "'*:file:_files'")
        lists.append(f"        {verb.name}) _arguments -s {' '.join(lines)} ;;")
    return ZSH.format(names=names, verbs="\n".join(lists))


def fish(known: list[Verb]) -> str:
    """Write the script for fish.

    Args:
        known: The verbs.

    Returns:
        Its text, for ~/.config/fish/completions/lgvi-warp.fish.
    """
    lines = [
        f"complete -c lgvi-warp -n __fish_use_subcommand -f -a {verb.name} -d {_quoted(verb.text)}" for verb in known
    ]
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
