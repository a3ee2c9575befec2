# SPDX-License-Identifier: Apache-2.0
"""Studies over many runs: cost against accuracy, suggested settings, stability maps and sensitivity."""
