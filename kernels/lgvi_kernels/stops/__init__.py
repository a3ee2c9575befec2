"""The events that a scene may name, one file each: `params(width, real)` and `distance(view, p)`, positive until the event."""

from lgvi_kernels.stops import box, floor, surface, time

STOPS = {"surface": surface, "floor": floor, "box": box, "time": time}
