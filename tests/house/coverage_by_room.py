# SPDX-License-Identifier: Apache-2.0
"""Print which part of each room's lines the last `make coverage` ran: `python -m tests.house.coverage_by_room`."""

from collections import Counter
from pathlib import Path

from coverage import Coverage

import lgvi_warp

PACKAGE = Path(lgvi_warp.__file__).parent


def main():
    data = Coverage()
    data.load()
    statements, missed = Counter(), Counter()
    for path in sorted(data.get_data().measured_files()):
        _, lines, _, missing, _ = data.analysis2(path)
        room, *file = Path(path).relative_to(PACKAGE).parts
        room = room if file else "(package)"
        for key in (room, "all"):
            statements[key] += len(lines)
            missed[key] += len(missing)
    print(f"{'room':12} {'lines':>6} {'run':>6}")
    for room in sorted(statements, key=lambda name: (name == "all", name)):
        print(f"{room:12} {statements[room]:6d} {1 - missed[room] / statements[room]:6.1%}")


if __name__ == "__main__":
    main()
