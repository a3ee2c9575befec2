# SPDX-License-Identifier: Apache-2.0
"""Estimates: the values of a statistic with their intervals, by sample time."""

from __future__ import annotations

import functools
import json
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.errors import MissingExtra, brief, closest
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.statistics.estimates.lines import texts_of
from lgvi_warp.statistics.estimates.naming import canonical, free
from lgvi_warp.statistics.estimates.tree import arrays_under

if TYPE_CHECKING:
    import xarray


Dims = dict[str, tuple[str, ...]]


# What an estimate holds beside its arrays.
WORDS = ("name", "settings", "unit", "confidence", "interval", "dims")


# Type of a statistic -> an array that its estimates lack where an earlier version gathered them: their value meant
# something else.
SINCE = {"outcome": "alone", "first_passage": "stopped"}


def along(names: Iterable[str], *dims: str) -> Dims:
    """Return the same dimensions for several arrays."""
    return dict.fromkeys(names, dims)


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Summarized):
    """The values of one statistic with their intervals, as named arrays: estimate["count"].

    Arrays that all estimates have are also attributes: value, lower, upper, count.

    Args:
        name: name of the statistic, such as "mean position".
        settings: the statistic's table, as in a scene file.
        unit: unit of the value.
        confidence: confidence level of the intervals.
        interval: text on the kind of the interval.
        dims: names of each array's dimensions: "time" (of length 1 for a statistic of paths), then component, level or
            bin.
        arrays: the arrays by name.
        coordinates: coordinates of the dimensions: "time" (k,) [s], "component" and so on.
    """

    name: str
    settings: dict[str, Any]
    unit: str
    confidence: float
    interval: str
    dims: Dims
    arrays: dict[str, np.ndarray]
    coordinates: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return one of the arrays by its name."""
        return self.arrays[name]

    def _array(self, name: str) -> np.ndarray:
        """One of the arrays that most estimates have, as an attribute."""
        if name not in self.arrays:
            raise AttributeError(f"{self.name!r} has no {name}. It has {', '.join(self.arrays)}", name=name, obj=self)
        return self.arrays[name]

    @property
    def value(self) -> np.ndarray:
        """The estimated statistic itself, with dimensions `dims["value"]`."""
        return self._array("value")

    @property
    def lower(self) -> np.ndarray:
        """Lower ends of the intervals, shaped like `value`."""
        return self._array("lower")

    @property
    def upper(self) -> np.ndarray:
        """Upper ends of the intervals, shaped like `value`."""
        return self._array("upper")

    @property
    def half_width(self) -> np.ndarray:
        """Distance from the value to the farther end of its interval; infinite if the interval is unbounded."""
        with np.errstate(invalid="ignore"):
            return np.fmax(self.upper - self.value, self.value - self.lower)

    @property
    def count(self) -> np.ndarray:
        """Number of members that contribute to the value at each time, (k,)."""
        return self._array("count")

    @property
    def time(self) -> np.ndarray:
        """Sample times (k,) [s] of the values."""
        return self.coordinates["time"]

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        return f"Estimate {self.name!r} at {self.time[-1]:g} s", [
            *_shown(self),
            ("arrays", summaries.listed(self.arrays, 30)),
        ]

    def with_interval(self, interval: str, arrays: Mapping[str, np.ndarray]) -> Estimate:
        """Return the estimate with another interval: its kind and its arrays; new arrays are shaped like the value."""
        dims = {name: self.dims["value"] for name in arrays} | dict(self.dims)
        return replace(self, interval=interval, dims=dims, arrays=self.arrays | dict(arrays))

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """The arrays as an xarray Dataset; ImportError if xarray is not installed (extra: store)."""
        try:
            import xarray as xr
        except ImportError as error:
            raise MissingExtra("datasets", "xarray", "store") from error
        data = {
            name: (self.dims[name], values, {"units": self.unit} if name in ("value", "lower", "upper") else {})
            for name, values in self.arrays.items()
        }
        used = {dim for dims in self.dims.values() for dim in dims}
        known = {name: values for name, values in self.coordinates.items() if name in used}
        attributes = {"long_name": self.name, "confidence": self.confidence, "interval": self.interval}
        return xr.Dataset(data, known, attributes | {"settings": json.dumps(self.settings)})


class Estimates(Summarized, Mapping[str, Estimate]):
    """The estimates of a run by name, in the order of the statistics; a name with "above 10.0" also finds "above 10".

    Attributes:
        messages: notes for the user; for the statistics of a run, the notes are in its result.
    """

    def __init__(self, estimates: Sequence[Estimate] = (), messages: tuple[str, ...] = ()):
        self.messages = messages
        self._found = {estimate.name: estimate for estimate in estimates}
        self._spelled = {canonical(name): name for name in self._found}

    def __getitem__(self, name: str) -> Estimate:
        if name not in self._found and isinstance(name, str):
            name = self._spelled.get(canonical(name), name)
        if name not in self._found:
            hint = closest(name, self._found) if self._found else "none were asked for: give statistics=[...]"
            raise KeyError(f"{brief(name)} is not a statistic of this run. {capital(hint)}")
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        end = max((estimate.time[-1] for estimate in self.values()), default=0.0)
        rows = [row for estimate in self.values() for row in _shown(estimate)]
        return f"Estimates of {len(self)} statistics at {end:g} s", rows + [("message", text) for text in self.messages]

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """All estimates as one xarray Dataset.

        "mean position" becomes the variable mean_position, and the lower end of its interval mean_position_lower. In
        names of variables -0.5 becomes minus_0_5. If names would be equal, the later ones end in _2, _3.
        """
        import xarray as xr

        datasets, taken = [], {"time"}
        for estimate in self.values():
            single = estimate.dataset
            word = free(estimate.name, lambda word, single=single: _renamed(single, word).values(), taken)  # type: ignore[misc]
            for name in single.data_vars:
                single[name].attrs |= {"long_name": f"{name} of {estimate.name}", "interval": estimate.interval}
            datasets.append(single.rename(_renamed(single, word)).drop_attrs(deep=False))
        return xr.merge(datasets, join="exact", compat="equals")

    def to_arrays(self) -> tuple[dict[str, np.ndarray], str]:
        """Return the estimates in a form that a file can hold."""
        arrays, words = dict[str, np.ndarray](), []
        for i, estimate in enumerate(self.values()):
            arrays |= {f"{i}/{name}": values for name, values in estimate.arrays.items()}
            arrays |= {f"{i}/coordinates/{name}": values for name, values in estimate.coordinates.items()}
            words.append({key: getattr(estimate, key) for key in WORDS})
        return arrays, json.dumps(words)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], text: str) -> Estimates:
        """Return the estimates that `to_arrays` has written."""
        estimates = []
        for i, words in enumerate(parsed(text)):
            estimate_arrays = arrays_under(arrays, f"{i}/")
            coordinates = arrays_under(estimate_arrays, "coordinates/")
            words["dims"] = {name: tuple(dims) for name, dims in words["dims"].items()}
            values = {name: array for name, array in estimate_arrays.items() if not name.startswith("coordinates/")}
            if SINCE.get(words["settings"]["type"], "value") not in values:
                raise ValueError(f"{words['name']!r} is of an earlier version, which took other events for censoring")
            estimates.append(Estimate(**words, arrays=values, coordinates=coordinates))
        return cls(estimates)


def _shown(estimate: Estimate) -> summaries.Rows:
    """Label, value and interval of each number of an estimate at the last sample time."""
    lines = [(label, f"{value}, {ends}, {members}") for label, value, ends, members in texts_of(estimate)]
    return lines or [
        (estimate.name, f"{' x '.join(map(str, estimate.value.shape))} values ({', '.join(estimate.dims['value'])})")
    ]


def _renamed(single: xarray.Dataset, word: str) -> dict[Hashable, str]:
    """Names of variables and dimensions of an estimate's dataset that distinguish it from the others."""
    names = {name: word if name == "value" else f"{word}_{name}" for name in single.data_vars}
    return names | {d: f"{d}_of_{word}" for d, n in single.sizes.items() if d != "time" or n == 1}
