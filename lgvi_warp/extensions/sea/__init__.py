# SPDX-License-Identifier: Apache-2.0
"""The sea as it is forecast: sea states and tides."""

HOLDS = {"terms": {"sea_state": ".terms.sea_state", "tide": ".terms.tide"}}
