"""Studies over many runs: cost against accuracy, suggested settings, stability maps and sensitivity."""
