# SPDX-License-Identifier: Apache-2.0
"""Sea states of forecasts, tides, and contact with the sea floor."""

# Where the device code of the terms is.
DEVICE = f"{__name__}.device"
HOLDS = {
    "terms": {
        "bottom_contact": ".terms.bottom_contact",
        "sea_state": ".terms.sea_state",
        "tide": ".terms.tide",
    }
}
