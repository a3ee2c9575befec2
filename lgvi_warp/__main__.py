# SPDX-License-Identifier: Apache-2.0
"""Run the command as `python -m lgvi_warp`."""

from lgvi_warp_command import entry

if __name__ == "__main__":
    entry()
