# SPDX-License-Identifier: Apache-2.0
"""The command lgvi-warp: its arguments, verbs, reports and signals."""

from lgvi_warp.cli.arguments import parser
from lgvi_warp.cli.command import entry, main
from lgvi_warp.cli.progress import Progress
from lgvi_warp.cli.settings import overrides

__all__ = ["Progress", "entry", "main", "overrides", "parser"]
