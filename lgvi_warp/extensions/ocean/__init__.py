# SPDX-License-Identifier: Apache-2.0
"""Readers of ocean data: currents and sea floors in the CF conventions, and rasters of the sea floor."""

# By the type of the term or event whose numbers are read: what a user may ask, and the function that reads it.
HOLDS = {
    "requests": {"current_field": ".field_data:FieldRequest", "floor": ".floor_request:FloorRequest"},
    "readers": {"current_field": ".field_reader:read_field", "floor": ".floor_data:read_floor"},
}
