"""Vehicles that come with the package, and importers of Fossen's coefficients, YAML, SDF and URDF."""
