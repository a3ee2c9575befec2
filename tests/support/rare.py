# SPDX-License-Identifier: Apache-2.0
"""A search for a rare event with what most tests ask of it."""

from functools import partial

from lgvi_warp.uncertainty.rare import search

RareSearch = partial(search.RareSearch, relative_error=0.1, seed=0, most=1_000_000)
