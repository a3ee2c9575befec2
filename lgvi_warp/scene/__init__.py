# SPDX-License-Identifier: Apache-2.0
"""Scenes, ensembles of varied members, and the scene files that describe both."""
