# SPDX-License-Identifier: Apache-2.0
"""A permanent magnet in the hull, for lgvi_warp. Nothing is imported before a scene names it."""

# {table: {word: place}}: the type in scene files, and the name behind the door lw.terms.
HOLDS = {
    "terms": {"magnet": ".term"},
    "lw.terms": {"Magnet": ".term:Magnet"},
}
