# SPDX-License-Identifier: Apache-2.0
"""Runs as files of other programs: one module for each kind of file, and the tracks that all of them write."""
