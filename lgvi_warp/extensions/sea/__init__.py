# SPDX-License-Identifier: Apache-2.0
"""The sea as it is forecast: sea states."""

HOLDS = {"terms": {"sea_state": ".terms.sea_state"}}
