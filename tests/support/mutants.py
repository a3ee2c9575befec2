# SPDX-License-Identifier: Apache-2.0
"""Do the tests find faults? Put random one-line faults into the code and count those that no test finds.

    python -m tests.support.mutants --record                             once: what each test runs, half an hour on 2 cores
    python -m tests.support.mutants --record tests/unit/test_new.py      the same for new tests alone
    python -m tests.support.mutants --room runs --sample 40 --seed 1     40 faults in lgvi_warp/runs
    python -m tests.support.mutants --room kernels/maps --only 17        the fault of that number again

A fault is put into a copy of the tree with a kernel cache of its own. Then the tests run that execute its line (of device
code: that run a kernel compiled from it), one of each function first, the fastest first. A fault is found when one fails,
ends its process or does not end; it survives when none does within --limit seconds. Tests that found a fault run once more
without it. equivalent_mutants.toml lists faults that change nothing, each with its reason; they are not counted.
"""

import argparse
import difflib
import functools
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.support.mutants_pytest import ROOT, SITE
from tests.support.mutations import mutants, parses

HOME = ROOT / ".mutants"
RECORDS, CACHE, SITES, PRISTINE = HOME / "records", HOME / "cache", HOME / "site", HOME / "pristine"
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
# Tests of one process: so much recorded time [s], first the fastest. Compiling a kernel takes a few seconds more.
BATCHES, COMPILE = (6.0, 30.0, 120.0, 1e9), 4.0
# A test has hung if it takes so much longer than recorded [s], on a busy machine too.
PATIENCE, SLOWER = 90.0, 15.0
MEMORY_KB = 8 << 20


def rooms():
    """Rooms by name, each a folder of code."""
    folders = {path.name: path for path in sorted((ROOT / "lgvi_warp").iterdir()) if (path / "__init__.py").exists()}
    kernels = ROOT / "kernels" / "lgvi_kernels"
    inner = {f"kernels/{p.name}": p for p in sorted(kernels.iterdir()) if (p / "__init__.py").exists()}
    return folders | inner | {"kernels": kernels}


def candidates(folder):
    """All faults of a room, as (path, fault), and the sources."""
    sources, found = {}, []
    for path in sorted(folder.rglob("*.py")):
        sources[path] = path.read_text()
        found += [(path, mutant) for mutant in mutants(sources[path], device=is_device(path))]
    return found, sources


def is_device(path):
    """Whether a file is device code."""
    return "lgvi_kernels" in path.parts or "device" in path.parts


def sampled(answer, sources, count, seed):
    """Some of the faults: each line is as likely as any other, then each kind of fault in it."""
    lines = defaultdict(lambda: defaultdict(list))
    for path, mutant in answer:
        lines[path, mutant.line][mutant.kind].append((path, mutant))
    known, draw, chosen = equivalent(), random.Random(seed), []
    places = list(lines)
    draw.shuffle(places)
    for place in places:
        kinds = lines[place]
        path, mutant = draw.choice(kinds[draw.choice(sorted(kinds))])
        counts = (str(path.relative_to(ROOT)), *mutant.shown(sources[path])) not in known
        if counts and parses(mutant.applied(sources[path])):
            chosen.append((path, mutant))
        if len(chosen) == count:
            break
    return chosen


def equivalent():
    """Faults that change nothing: (path, line before, line after)."""
    entries = tomllib.loads(EQUIVALENT.read_text()).get("mutant", [])
    return {(entry["path"], entry["before"], entry["after"]) for entry in entries}


# --- what each test runs


def record(arguments):
    """Run tests and write the lines, the kernels and the time of each."""
    RECORDS.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=time.strftime("%Y%m%d-%H%M%S-"), dir=RECORDS))
    tree = folder / "tree"
    copy_tree(tree)
    SITES.mkdir(parents=True, exist_ok=True)
    (SITES / "sitecustomize.py").write_text(SITE)
    environment = environment_of(tree, CACHE, folder / "tmp")
    CACHE.mkdir(parents=True, exist_ok=True)
    environment["MUTANTS_RECORD"] = str(folder)
    environment["PYTHONPATH"] = f"{SITES}{os.pathsep}{environment['PYTHONPATH']}"
    command = [
        sys.executable, "-m", "pytest", *PYTEST, "-m", "not slow",
        *(arguments or ["-n", "2", "--dist", "worksteal", "tests"]),
    ]  # fmt: skip
    code = subprocess.run(command, cwd=tree, env=environment).returncode
    shutil.rmtree(folder / "tmp", ignore_errors=True)
    combine(folder)
    return code


def combine(folder):
    """Join what the processes of one record wrote."""
    import coverage

    measured = coverage.Coverage(data_file=str(folder / "joined"), config_file=False)
    measured.combine([str(path) for path in folder.glob("coverage.*")])
    measured.save()


class Record:
    """Record of one run of the tests."""

    def __init__(self, folder):
        import coverage

        self.folder, self.tests = folder, {}
        for path in folder.glob("tests-*.jsonl"):
            for line in path.read_text().splitlines():
                test = json.loads(line)
                self.tests[test["test"]] = test
        self.data = coverage.CoverageData(str(folder / "joined"))
        self.data.read()
        self.by_name = defaultdict(list)
        for path in self.data.measured_files():
            self.by_name[Path(path).name].append(path)

    def file_of(self, path):
        """The recorded file: of the same path, or of the same name after a move."""
        exact = [p for p in self.by_name[path.name] if p.endswith(f"/{path.relative_to(ROOT)}")]
        return (exact or self.by_name[path.name] or [None])[0]

    @functools.cache
    def lines_of(self, path):
        """Each line of a file as it is now -> tests that executed it; and the tests of any line inside a function."""
        recorded = self.file_of(path)
        if recorded is None:
            return {}
        tests = self.data.contexts_by_lineno(recorded)
        source = Path(recorded)
        if not source.exists():  # the tree was moved after the record
            source = next((p for p in (self.folder / "tree").rglob(path.name) if recorded.endswith(str(p)[-30:])), path)
        before, now = source.read_text().splitlines(), path.read_text().splitlines()
        same = {}
        for a, b, size in difflib.SequenceMatcher(None, before, now, autojunk=False).get_matching_blocks():
            same.update({b + i + 1: a + i + 1 for i in range(size)})
        return {line: {test for test in tests.get(same[line], ()) if test} for line in same}

    @functools.cached_property
    def kernels(self):
        """(line of def, line) of device code, as texts -> kernels compiled from it."""
        found = defaultdict(set)
        # Warp's cache has a folder for each of its versions.
        folders = {path.name: path for path in (*CACHE.glob("wp_*"), *CACHE.glob("*/wp_*"))}
        for kernel in {name for test in self.tests.values() for name in test["kernels"]} & folders.keys():
            for path in folders[kernel].glob("*.cpp"):
                definition = ""
                for text in re.findall(r"^ *// (.*\S) +<L \d+>$", path.read_text(), re.MULTILINE):
                    definition = text if text.startswith("def ") else definition
                    found[definition, text].add(kernel)
        assert found or not any(test["kernels"] for test in self.tests.values()), f"no source of a kernel in {CACHE}"
        return found

    @functools.cached_property
    def runs_of(self):
        """Each kernel -> tests that run it."""
        found = defaultdict(set)
        for name, test in self.tests.items():
            for kernel in test["kernels"]:
                found[kernel].add(name)
        return found

    def tests_of_device(self, path, mutant):
        """Tests whose kernels are compiled from this line: (in it, in its function, in its file)."""
        lines = [line.strip() for line in path.read_text().splitlines()]
        near = {definition for definition, _ in self.kernels}
        definitions = [text for text in lines if text in near]
        above = [text for text in lines[: mutant.line] if text in near]
        definition = above[-1] if above else ""
        exact = self.kernels.get((definition, lines[mutant.line - 1]), set())
        function = self.kernels.get((definition, definition), set())
        whole = set().union(*(self.kernels[text, text] for text in definitions))
        return [set().union(*(self.runs_of[k] for k in kernels)) for kernels in (exact, function, whole)]

    def levels(self, path, mutant):
        """Sets of tests, the likeliest first: of the line, then of its file."""
        lines = self.lines_of(path)
        end = mutant.line
        exact, anywhere = lines.get(end, set()), set().union(*lines.values()) if lines else set()
        if is_device(path):
            return [*self.tests_of_device(path, mutant), exact, anywhere]
        return [exact, anywhere]


def tests_for(records, path, mutant):
    """Tests to run, in order, as their records; what a later record has replaces an earlier one."""
    chosen, seen, device = [], set(), is_device(path)
    levels = [record.levels(path, mutant) for record in records]
    known = {}
    for record in records:
        known.update({name: (record, test) for name, test in record.tests.items()})
    for level in range(max((len(found) for found in levels), default=0)):
        names = set()
        for record, found in zip(records, levels):
            names |= {n for n in found[level] if n in known and known[n][0] is record} if level < len(found) else set()
        # What a fixture of a module runs is recorded of the first test that asks for it, and others of the file look at it.
        files = {known[name][1]["path"] for name in names}
        beside = {name for name, (_, test) in known.items() if test["path"] in files} - names
        for group in (names, beside):
            group = {name for name in group - seen if not known[name][1]["failed"]}
            seen |= group
            chosen += in_order([known[name][1] | {"test": now(name)} for name in group if now(name)], device)
        if chosen and level == 0 and not device and inside_function(path, mutant.line):
            break  # a line of a function: other tests of the file do not run it
    return chosen


def in_order(tests, device):
    """One test of each function first, the fastest first."""
    place, counts = {}, defaultdict(int)
    for test in sorted(tests, key=lambda test: cost(test, device)):
        function = test["test"].split("[")[0]
        place[test["test"]] = counts[function]
        counts[function] += 1
    return sorted(tests, key=lambda test: (place[test["test"]] > 0, cost(test, device)))


def cost(test, device=False):
    """Expected time of a test, with its kernels compiled anew if the fault is in device code [s]."""
    return test["time"] + device * COMPILE * len(test["kernels"])


@functools.cache
def cached_or_outside(path):
    """Lines outside of functions, and in functions whose results are kept: these run in the first test alone."""
    import ast

    tree, inside, kept = ast.parse(path.read_text()), set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            lines = set(range(node.body[0].lineno, node.end_lineno + 1))
            inside |= lines
            if any("cache" in ast.unparse(decorator) for decorator in node.decorator_list):
                kept |= lines
    return inside - kept


def inside_function(path, line):
    """Whether every test that needs a line executes it itself."""
    return line in cached_or_outside(path)


@functools.cache
def where():
    """Each test file's name -> its path now."""
    return {path.name: str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py")}


@functools.cache
def defined():
    """Each test function -> names of the files that define it."""
    found = defaultdict(set)
    for name, path in where().items():
        for function in re.findall(r"^def (test_\w+)", (ROOT / path).read_text(), re.MULTILINE):
            found[function].add(name)
    return found


def now(test):
    """A recorded test's name now: in its file, or in the only one that has it after a move; else None."""
    file, _, name = test.partition("::")
    files = defined()[name.split("[")[0]]
    return test if file in files else f"{next(iter(files))}::{name}" if len(files) == 1 else None


# --- a fault at work

PYTEST = ["-q", "--tb=line", "-p", "no:cacheprovider", "-p", "tests.support.mutants_pytest"]


def copy_tree(folder):
    """Copy of the tree as git knows it, and new files, with their times."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def environment_of(tree, cache, temporary):
    """Environment of tests in a tree."""
    temporary.mkdir(parents=True, exist_ok=True)
    paths = os.pathsep.join((str(tree), str(tree / "kernels")))
    own = {"PYTHONPATH": paths, "WARP_CACHE_PATH": str(cache), "TMPDIR": str(temporary), "PYTHONHASHSEED": "0"}
    return os.environ | own | {"HYPOTHESIS_STORAGE_DIRECTORY": str(temporary), "PYTHONDONTWRITEBYTECODE": "1"}


@functools.cache
def apart():
    """A command that keeps a fault's processes apart: none of ours can be killed, none of its own is left."""
    command = ["unshare", "--pid", "--fork", "--kill-child", "--mount", "--mount-proc"]
    try:
        subprocess.run([*command, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return []
    top = Path(*ROOT.parts[:2])
    return [*command, "bash", "-c", f'ulimit -d {MEMORY_KB}; mount -o bind,ro "{top}" "{top}" && exec "$0" "$@"']


class Slot:
    """A copy of the tree in which one fault after the other is tried."""

    def __init__(self, folder):
        self.folder, self.tree = Path(folder), Path(folder) / "tree"
        copy_tree(self.tree)
        command = [*apart(), sys.executable, str(Path(__file__).with_name("mutants_server.py"))]
        environment = environment_of(self.tree, CACHE, self.folder / "tmp")
        self.server = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, start_new_session=True
        )
        self.server.stdout.readline()  # it is ready: no fault waits for its imports

    def close(self):
        """End its process."""
        self.server.stdin.close()
        self.server.wait()

    def run(self, tests, seconds, device=False):
        """Run tests until one fails.

        Returns:
            The test that failed, and how; or None.
        """
        temporary, cache, select = self.folder / "tmp", self.folder / "cache", self.folder / "select.json"
        shutil.rmtree(temporary, ignore_errors=True)
        if not cache.exists() and CACHE.exists():
            shutil.copytree(CACHE, cache, copy_function=os.link)
        select.write_text(json.dumps({test["test"]: PATIENCE + SLOWER * cost(test, device) for test in tests}))
        select.with_suffix(".outcome").unlink(missing_ok=True)
        files = dict.fromkeys(where()[test["test"].split("::")[0]] for test in tests)
        task = {
            "tree": str(self.tree),
            "log": str(self.folder / "log"),
            "environment": environment_of(self.tree, cache, temporary) | {"MUTANTS_SELECT": str(select)},
            "arguments": [*PYTEST, "-x", "--basetemp", str(temporary / "pytest"), *files],
            "seconds": seconds,
        }
        self.server.stdin.write(json.dumps(task) + "\n")
        self.server.stdin.flush()
        in_time = json.loads(self.server.stdout.readline())
        try:
            outcome = json.loads(select.with_suffix(".outcome").read_text())
        except (OSError, ValueError):
            outcome = {"test": "", "outcome": "not started"}
        if outcome["outcome"] == "passed" or (not in_time and outcome["outcome"] != "failed"):
            return None
        how = {"running": "ended or hung", "not started": "not collected"}.get(outcome["outcome"], "failed")
        return outcome["test"] or tests[0]["test"], how

    def tried(self, path, mutant, tests, limit):
        """Whether a test finds a fault: (test and how, or None; seconds; tests run)."""
        place = self.tree / path.relative_to(ROOT)
        source, begin, ran = place.read_text(), time.perf_counter(), 0
        try:
            place.write_text(mutant.applied(source))
            for batch in batches(tests, is_device(path)):
                left = limit - (time.perf_counter() - begin)
                if left <= 0:
                    break
                found = self.run(batch, max(left, 30.0), is_device(path))
                ran += len(batch)
                if found:
                    return found, time.perf_counter() - begin, ran
            return None, time.perf_counter() - begin, ran
        finally:
            place.write_text(source)
            if {"common", "engine"} & set(path.parts):  # what writes kernels may have spoilt them
                shutil.rmtree(self.folder / "cache", ignore_errors=True)


def batches(tests, device):
    """Tests in groups of growing time, each run by a process."""
    rest = list(tests)
    for most in BATCHES:
        batch, total = [], 0.0
        while rest and (not batch or total + cost(rest[0], device) <= most):
            batch.append(rest.pop(0))
            total += cost(batch[-1], device)
        if batch:
            # One file after the other: fixtures of a file are made once.
            first = {}
            for i, test in enumerate(batch):
                first.setdefault(test["test"].split("::")[0], i)
            yield sorted(batch, key=lambda test: first[test["test"].split("::")[0]])


# --- the command


def try_room(name, count, seed, limit, jobs, only):
    """Try a room's faults and print a line for each.

    Returns:
        Counts: {"faults": n, "found": n, "survived": n, "unsure": n}.
    """
    found, sources = candidates(rooms()[name])
    chosen = list(enumerate(sampled(found, sources, count, seed)))
    chosen = [c for c in chosen if not only or c[0] in only]
    records = [Record(folder) for folder in sorted(RECORDS.glob("*")) if (folder / "joined").exists()]
    if not records:
        sys.exit("no record of the tests: first python -m tests.support.mutants --record")
    tests = {i: tests_for(records, path, mutant) for i, (path, mutant) in chosen}
    outcomes = {}
    with tempfile.TemporaryDirectory(prefix="mutants_", ignore_cleanup_errors=True) as folder:
        slots = [Slot(f"{folder}/{j}") for j in range(jobs)]

        def trial(item):
            i, (path, mutant) = item
            slot = slots.pop()
            try:
                outcome = slot.tried(path, mutant, tests[i], limit)
            finally:
                slots.append(slot)
            outcomes[i] = outcome
            caught, seconds, ran = outcome
            verdict = (
                f"found by {caught[0]} ({caught[1]})" if caught else f"SURVIVED {ran} of {len(tests[i])} tests begun"
            )
            before, after = mutant.shown(sources[path])
            where = f"{path.relative_to(ROOT)}:{mutant.line}"
            print(f"{name} {i} {where} {mutant.kind}: {before} -> {after}: {verdict} in {seconds:.0f} s", flush=True)

        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(trial, chosen))
        unsure = unsound(slots[0], {o[0][0] for o in outcomes.values() if o[0]}, tests)
        for slot in slots:
            slot.close()
    counts = {"faults": len(outcomes), "found": 0, "survived": 0, "unsure": 0}
    for caught, _, _ in outcomes.values():
        counts["survived" if not caught else "unsure" if caught[0] in unsure else "found"] += 1
    if unsure:
        print(f"{name}: these tests fail without a fault: {sorted(unsure)}", flush=True)
    return counts


def unsound(slot, names, tests):
    """Tests that fail without a fault."""
    known = {test["test"]: test for chosen in tests.values() for test in chosen}
    passed = set(PRISTINE.read_text().splitlines()) if PRISTINE.exists() else set()
    left, failing = [known[name] for name in sorted(names - passed) if name in known], set()
    while left:
        found = slot.run(left, 1e6)
        if not found:
            break
        failing.add(found[0])
        left = [test for test in left if test["test"] != found[0]]
    with PRISTINE.open("a") as file:
        file.writelines(f"{name}\n" for name in sorted(names - failing - passed))
    return failing


def main():
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--record",
        nargs=argparse.REMAINDER,
        metavar="TESTS",
        help="record what tests run (default: those of make test-ci)",
    )
    parser.add_argument("--room", action="append", choices=list(rooms()), help="default: every room")
    parser.add_argument("--sample", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=240.0, help="seconds for each fault")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of faults of this sample")
    arguments = parser.parse_args()
    if arguments.record is not None:
        return record(arguments.record)
    all_rooms = [name for name in rooms() if "/" not in name]
    counts = {}
    for name in arguments.room or all_rooms:
        counts[name] = try_room(name, arguments.sample, arguments.seed, arguments.limit, arguments.jobs, arguments.only)
        print(json.dumps({name: counts[name]}), flush=True)
    print(json.dumps({"seed": arguments.seed, "sample": arguments.sample, "rooms": counts}, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
