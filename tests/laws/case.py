# SPDX-License-Identifier: Apache-2.0
"""Case of a law: its term beside its twin."""

from importlib import import_module
from typing import NamedTuple

import numpy as np


class Case(NamedTuple):
    """The terms of a scene and the same laws of the twin. smooth: whether an order of convergence can be seen."""

    terms: tuple
    laws: tuple
    smooth: bool = True


def matrix(seed, size=1.0):
    """A symmetric positive definite matrix (6, 6) that couples everything."""
    A = np.random.default_rng(seed).normal(size=(6, 6))
    return size * (A @ A.T / 6.0 + np.eye(6))


def twin_of(module):
    """The module of the twin of a term, or a part of a controller, by its module."""
    if module.startswith("lgvi_warp.extensions."):
        return module.replace(".terms.", ".twin.").replace(".control.", ".twin.")
    return module.replace("physics", "reference").replace("lgvi_warp.control", "lgvi_warp.reference.control")


def case(host, **numbers):
    """A Case of one term and its twin of the same name, whose numbers have the same names."""
    twin = getattr(import_module(twin_of(host.__module__)), host.__name__)
    return Case((host(**numbers),), (twin(**{key: np.asarray(value) for key, value in numbers.items()}),))
