"""The events a scene may name, one file each: `params(width, real)` and `distance(view, p)`, positive while all is well."""

from lgvi_kernels.stops import box, floor, surface, time

STOPS = {"surface": surface, "floor": floor, "box": box, "time": time}
