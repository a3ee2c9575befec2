"""Run the benchmarks: each prints JSON lines, every figure a ratio to a peer or a limit measured in the same run.

python benchmarks/run.py             all cases
python benchmarks/run.py kernel      one of them; --quick for fewer members and steps
"""

import argparse
import importlib
import json
import pkgutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import cases
from lgvi_warp.common import machine, warp_setup


def main():
    names = sorted(module.name for module in pkgutil.iter_modules(cases.__path__))
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("cases", nargs="*", choices=[*names, []], metavar="CASE", help=", ".join(names))
    arguments.add_argument("--quick", action="store_true", help="fewer members and steps: to see that it runs")
    chosen = arguments.parse_args()
    warp_setup.start()
    print(json.dumps({"case": "machine"} | machine.describe() | machine.versions()), flush=True)
    for name in chosen.cases or names:
        case = importlib.import_module(f"benchmarks.cases.{name}.case")
        for record in case.run(chosen.quick):
            print(json.dumps({"case": name} | record), flush=True)


if __name__ == "__main__":
    main()
