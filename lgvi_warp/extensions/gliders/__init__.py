# SPDX-License-Identifier: Apache-2.0
"""Underwater gliders: moving masses, ballast, polars, compressible hulls, and water whose density varies with depth."""

# Where the device code of the terms is.
DEVICE = f"{__name__}.device"
HOLDS = {
    "terms": {
        "ballast": ".terms.ballast",
        "buoyancy_engine": ".terms.buoyancy_engine",
        "density_profile": ".terms.density_profile",
        "moving_mass": ".terms.moving_mass",
        "polar": ".terms.polar",
        "stratification": ".terms.stratification",
        "surface_buoyancy": ".terms.surface_buoyancy",
    },
    "vehicles": {"seawing": "vehicles/seawing.toml", "slocum": "vehicles/slocum.toml"},
}
