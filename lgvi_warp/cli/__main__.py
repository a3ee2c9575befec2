# SPDX-License-Identifier: Apache-2.0
"""Run the command as `python -m lgvi_warp.cli`."""

from lgvi_warp.cli import entry

if __name__ == "__main__":
    entry()
