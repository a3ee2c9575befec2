# SPDX-License-Identifier: Apache-2.0
"""Measure speed, compare with other systems, and write the tables of the docs. Run from the root of the repository.

python -m benchmarks run [CASE...]           speed: JSON lines, each figure a ratio to a peer or a limit of the same run
python -m benchmarks peers [--help]          the same problem solved by other systems
python -m benchmarks table NAME [--help]     measure, print, and write the table into its page
python -m benchmarks history [--draw]        append the small set to the history of speed, or draw its ratios over commits
"""

import argparse
import ast
import importlib
import pkgutil
import sys
from pathlib import Path

# NumPy counts the cores as it is imported, and peers are given theirs first: nothing up here imports it.
from benchmarks import cases, history, pages, tables
from benchmarks.peers import run as peers


def names(package):
    """Modules of a package."""
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))


def sentence(path):
    """First sentence of a module's docstring, read without the import of what the module needs."""
    return ast.get_docstring(ast.parse(path.read_text())).split("\n")[0]


def listed(package, file):
    """A line of help for each module of a package. file: where its docstring stands, for its name."""
    folder = Path(package.__path__[0])
    return "\n".join(f"  {name:18}{sentence(folder / file.format(name))}" for name in names(package))


def run(arguments):
    """Measure cases and print them."""
    parser = parser_of("run", __doc__.split("\n")[0] + f"\n\ncases:\n{listed(cases, '{}/case.py')}")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="default: all")
    parser.add_argument("--quick", action="store_true", help="fewer members and steps: to see that it runs")
    chosen = parser.parse_args(arguments)
    known(parser, chosen.cases, names(cases))
    from lgvi_warp.common import machine, warp_setup

    warp_setup.start()
    pages.show({"case": "machine"} | machine.describe() | machine.versions())
    for name in chosen.cases or names(cases):
        case = importlib.import_module(f"benchmarks.cases.{name}.case")
        for record in case.run(chosen.quick):
            pages.show({"case": name} | record)


def table(arguments):
    """Measure a table."""
    parser = parser_of("table", f"tables:\n{listed(tables, '{}.py')}")
    parser.add_argument("name", metavar="NAME")
    name = parser.parse_args(arguments[:1]).name
    known(parser, [name], names(tables))
    module = importlib.import_module(f"benchmarks.tables.{name}")
    parser = parser_of(f"table {name}", module.__doc__)
    if hasattr(module, "add_options"):
        module.add_options(parser)
    if name in pages.PAGES:
        default = pages.ROOT / pages.PAGES[name]
        parser.add_argument("--out", type=Path, default=default, help=f"the page (default {pages.PAGES[name]})")
    options = vars(parser.parse_args(arguments[1:]))
    page = options.pop("out", None)
    if page:
        pages.parts(name, page)  # its marks are missed now, not after hours of measuring
    from lgvi_warp.common import warp_setup

    warp_setup.start()
    text = module.main(**options)
    if page and text:
        print(text)
        pages.write(name, page, text)


def compare(arguments):
    """Measure lgvi_warp beside other systems."""
    parser = parser_of("peers", peers.__doc__)
    peers.add_options(parser)
    peers.main(**vars(parser.parse_args(arguments)))


def keep(arguments):
    """Append to the history of speed, or draw it."""
    parser = parser_of("history", history.__doc__)
    parser.add_argument("--rows", type=Path, default=history.ROWS, help="the file of JSON lines (default %(default)s)")
    parser.add_argument("--quick", action="store_true", help="fewer members and steps: to see that it runs")
    parser.add_argument("--draw", action="store_true", help="draw the file and measure nothing")
    parser.add_argument("--picture", type=Path, default=history.PICTURE, help="with --draw (default %(default)s)")
    chosen = parser.parse_args(arguments)
    if chosen.draw:
        return history.draw(chosen.rows, chosen.picture)
    from lgvi_warp.common import warp_setup

    warp_setup.start()
    return history.record(chosen.rows, chosen.quick)


def parser_of(command, text):
    """A parser whose help keeps the lines of a text."""
    form = argparse.RawDescriptionHelpFormatter
    return argparse.ArgumentParser(prog=f"python -m benchmarks {command}", description=text, formatter_class=form)


def known(parser, chosen, every):
    """Refuse a name that is none of these."""
    for name in set(chosen) - set(every):
        parser.error(f"no {name!r}; one of {', '.join(every)}")


COMMANDS = {"run": run, "peers": compare, "table": table, "history": keep}


def main(arguments):
    """Carry out one command."""
    text = f"{__doc__}\ncases:\n{listed(cases, '{}/case.py')}\n\ntables:\n{listed(tables, '{}.py')}"
    parser = parser_of("", text)
    parser.add_argument("command", choices=COMMANDS)
    COMMANDS[parser.parse_args(arguments[:1]).command](arguments[1:])


if __name__ == "__main__":
    main(sys.argv[1:])
