"""Device code of lgvi_warp: Warp functions and kernels, written for packets of vehicles."""
