# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.views.plots.bars import sensitivity as sensitivity
from lgvi_warp.views.plots.costs import scaling as scaling
from lgvi_warp.views.plots.costs import term_cost as term_cost
from lgvi_warp.views.plots.edges import margins as margins
from lgvi_warp.views.plots.ends import histogram as histogram
from lgvi_warp.views.plots.ends import outcomes as outcomes
from lgvi_warp.views.plots.ends import pairs as pairs
from lgvi_warp.views.plots.estimates import statistics as statistics
from lgvi_warp.views.plots.fans import compare as compare
from lgvi_warp.views.plots.fans import fan as fan
from lgvi_warp.views.plots.footprints import footprint as footprint
from lgvi_warp.views.plots.loops import bode as bode
from lgvi_warp.views.plots.loops import nyquist as nyquist
from lgvi_warp.views.plots.maps import stability as stability
from lgvi_warp.views.plots.overview import drift as drift
from lgvi_warp.views.plots.overview import summary as summary
from lgvi_warp.views.plots.rare import rare as rare
from lgvi_warp.views.plots.tracks import attitude as attitude
from lgvi_warp.views.plots.tracks import paths as paths
from lgvi_warp.views.plots.tracks import phase as phase
from lgvi_warp.views.plots.tracks import plan_view as plan_view
from lgvi_warp.views.plots.tradeoffs import tradeoff as tradeoff
from lgvi_warp.views.recording.movie import movie as movie
