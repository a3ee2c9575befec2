# SPDX-License-Identifier: Apache-2.0
"""The pictures under their first names: with a file they give its path, without one the axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.views.plots.bars import sensitivity
from lgvi_warp.views.plots.estimates import statistics
from lgvi_warp.views.plots.maps import stability
from lgvi_warp.views.plots.overview import summary
from lgvi_warp.views.plots.picture import FilePath
from lgvi_warp.views.plots.tradeoffs import tradeoff

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.studies.sensitivity.indices import Indices
    from lgvi_warp.studies.stability.map import StabilityMap
    from lgvi_warp.studies.tradeoff import Tradeoff


def plot(result: Result, path: FilePath | None = None) -> Any:
    """Draw a run at a glance; see `lw.plots.summary`.

    Args:
        result: A result.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The path; without one the axes, shape (panels,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: Every member failed before the second sample, none has a finite position, or nothing was kept.
        OSError: The file cannot be written.
    """
    return _path_or(path, summary(result, path=path))


def plot_statistics(result: Result, path: FilePath | None = None) -> Any:
    """Draw a run's statistics against time; see `lw.plots.statistics`.

    Args:
        result: A result with statistics.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The path; without one the axes, shape (panels,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: There is no statistic against time (it is a ValueError).
        OSError: The file cannot be written.
    """
    return _path_or(path, statistics(result, path=path))


def plot_tradeoff(found: Tradeoff, path: FilePath | None = None, of: str | None = None) -> Any:
    """Draw error against cost; see `lw.plots.tradeoff`.

    Args:
        found: Measurements of `lw.tradeoff`.
        path: File to write; its ending chooses the format. Default None: none is written.
        of: Quantity of the errors, "position" and so on; default that of the trade-off.

    Returns:
        The path; without one the axes, shape (2,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: No setting was measured (it is a ValueError).
        OSError: The file cannot be written.
    """
    return _path_or(path, tradeoff(found, of, path=path))


def plot_stability(found: StabilityMap, path: FilePath | None = None) -> Any:
    """Draw a stability map; see `lw.plots.stability`.

    Args:
        found: A map of `lw.stability_map`.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The path; without one the axes, shape (methods,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        OSError: The file cannot be written.
    """
    return _path_or(path, stability(found, path=path))


def plot_sensitivity(found: Indices, path: FilePath | None = None) -> Any:
    """Draw sensitivity indices; see `lw.plots.sensitivity`.

    Args:
        found: Indices of `lw.uq.sobol` or `lw.uq.morris`.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The path; without one the axes, shape (quantities,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: No quantity varies (it is a ValueError).
        OSError: The file cannot be written.
    """
    return _path_or(path, sensitivity(found, path=path))


def _path_or(path: FilePath | None, axes: Any) -> Any:
    return axes if path is None else Path(path)
