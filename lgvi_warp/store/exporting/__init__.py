# SPDX-License-Identifier: Apache-2.0
"""Export of runs to files of other programs: one module for each format, and the tracks that all of them read."""
