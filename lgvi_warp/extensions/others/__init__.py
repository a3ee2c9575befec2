# SPDX-License-Identifier: Apache-2.0
"""Data assimilation, exports to maps and ROS, FMU export, and model predictive control."""

# Where the device code of the law is.
DEVICE = f"{__name__}.device"
HOLDS = {
    "laws": {"linear_mpc": ".control.linear_mpc"},
    # By the ending of a file. Each module has `write`, and `MOST_MEMBERS` where its files hold no more of a whole run.
    "exporters": {".geojson": ".exporting.geojson", ".kml": ".exporting.kml", ".mcap": ".exporting.ros"},
    # The same of a scene: each module has `scene_writer`.
    "scene_exporters": {".fmu": ".fmu.archive"},
    "studies": {"assimilate": ".assimilation.answer:Assimilated"},
}
