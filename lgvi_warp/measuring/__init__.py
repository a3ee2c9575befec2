# SPDX-License-Identifier: Apache-2.0
"""Cost and error of a setting: trials, references, searches for the longest step, speed."""
