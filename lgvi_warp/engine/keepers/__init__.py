"""Keepers: what a run retains of each block, namely outcomes, samples and statistics."""
