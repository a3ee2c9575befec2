# SPDX-License-Identifier: Apache-2.0
"""The parts of a recording: what is drawn of a run, the world, the graphs, the words, and their layout."""
