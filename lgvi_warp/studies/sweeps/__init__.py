"""Sweeps: cases of a closed loop on the same members, what of them holds, and which case is better."""
