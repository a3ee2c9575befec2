"""The laws a scene may name: one file each, with `params(width, real)`, the struct it reads, and `law(w, view, p)`."""

from lgvi_kernels.terms import restoring, weight

LAWS = {"weight": weight, "restoring": restoring}
