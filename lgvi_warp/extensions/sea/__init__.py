# SPDX-License-Identifier: Apache-2.0
"""The sea as it is forecast, and its floor: sea states, tides, and contact with the floor."""

# Where the device code of the terms is.
DEVICE = f"{__name__}.device"
HOLDS = {
    "terms": {
        "bottom_contact": ".terms.bottom_contact",
        "sea_state": ".terms.sea_state",
        "tide": ".terms.tide",
    }
}
