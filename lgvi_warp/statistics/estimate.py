"""What a statistic came to: its values with their intervals, by time."""

from __future__ import annotations

import functools
import json
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.statistics.naming import canonical, free

if TYPE_CHECKING:
    import xarray


Dims = dict[str, tuple[str, ...]]


def along(names: Iterable[str], *dims: str) -> Dims:
    """These arrays have these dimensions."""
    return dict.fromkeys(names, dims)


@dataclass(frozen=True, eq=False)
class Estimate:
    """One statistic: arrays by name, estimate["count"], those that all have also as attributes.

    value: the statistic, by time first (a path's: of length 1), then component, level or bin as `dims` says; lower, upper:
    its interval of this confidence, each entry for itself; count (k,): members that it is of. interval: how the
    interval was formed. coordinates: "time" [s], "component" and so on. settings: as in a scene file.
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
        """One of its arrays."""
        return self.arrays[name]

    @property
    def value(self) -> np.ndarray:
        """The statistic."""
        return self.arrays["value"]

    @property
    def lower(self) -> np.ndarray:
        """Lower end of the interval."""
        return self.arrays["lower"]

    @property
    def upper(self) -> np.ndarray:
        """Upper end of the interval."""
        return self.arrays["upper"]

    @property
    def half_width(self) -> np.ndarray:
        """The larger distance from the value to an end of its interval; infinite where there is no end."""
        with np.errstate(invalid="ignore"):
            return np.fmax(self.upper - self.value, self.value - self.lower)

    @property
    def count(self) -> np.ndarray:
        """(k,), members that it is of at each time."""
        return self.arrays["count"]

    @property
    def time(self) -> np.ndarray:
        """(k,) [s]."""
        return self.coordinates["time"]

    def with_interval(self, interval: str, arrays: Mapping[str, np.ndarray]) -> Estimate:
        """The same with an interval formed otherwise: these arrays instead of its own."""
        return replace(self, interval=interval, arrays=self.arrays | dict(arrays))

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """Its arrays as an xarray Dataset (extra: store)."""
        try:
            import xarray as xr
        except ImportError as error:
            raise ImportError("estimate.dataset needs xarray: pip install 'lgvi-warp[store]'") from error
        data = {
            name: (self.dims[name], values, {"units": self.unit} if name in ("value", "lower", "upper") else {})
            for name, values in self.arrays.items()
        }
        known = {
            name: values for name, values in self.coordinates.items() if any(name in d for d in self.dims.values())
        }
        attributes = {"long_name": self.name, "confidence": self.confidence, "interval": self.interval}
        return xr.Dataset(data, known, attributes | {"settings": json.dumps(self.settings)})


class Estimates(Mapping[str, Estimate]):
    """A run's statistics, by name, in the order that they were asked for; "above 10.0" in a name is "above 10"."""

    def __init__(self, estimates: Sequence[Estimate] = ()):
        self._found = {one.name: one for one in estimates}
        self._spelled = {canonical(name): name for name in self._found}

    def __getitem__(self, name: str) -> Estimate:
        if name not in self._found and isinstance(name, str):
            name = self._spelled.get(canonical(name), name)
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    @functools.cached_property
    def dataset(self) -> xarray.Dataset:
        """All as one xarray Dataset: "mean position" is the variable mean_position, its interval mean_position_lower.

        -0.5 in a name is minus_0_5; of names that make the same word the later ones end on _2, _3.
        """
        import xarray as xr

        whole, taken = [], {"time"}
        for one in self.values():
            single = one.dataset
            word = free(one.name, lambda word, single=single: _renamed(single, word).values(), taken)  # type: ignore[misc]
            for name in single.data_vars:
                single[name].attrs |= {"long_name": f"{name} of {one.name}", "interval": one.interval}
            whole.append(single.rename(_renamed(single, word)).drop_attrs(deep=False))
        return xr.merge(whole, join="exact", compat="equals")

    def to_arrays(self) -> tuple[dict[str, np.ndarray], str]:
        """Named arrays, and a text of all else, for a file."""
        arrays, words = dict[str, np.ndarray](), []
        for i, one in enumerate(self.values()):
            arrays |= {f"{i}/{name}": values for name, values in one.arrays.items()}
            arrays |= {f"{i}/coordinates/{name}": values for name, values in one.coordinates.items()}
            words.append(
                {key: getattr(one, key) for key in ("name", "settings", "unit", "confidence", "interval", "dims")}
            )
        return arrays, json.dumps(words)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], text: str) -> Estimates:
        """What `to_arrays` gave."""
        found = []
        for i, words in enumerate(json.loads(text)):
            own = {name.removeprefix(f"{i}/"): values for name, values in arrays.items() if name.startswith(f"{i}/")}
            head = "coordinates/"
            coordinates = {name.removeprefix(head): values for name, values in own.items() if name.startswith(head)}
            words["dims"] = {name: tuple(dims) for name, dims in words["dims"].items()}
            values = {name: values for name, values in own.items() if not name.startswith(head)}
            found.append(Estimate(**words, arrays=values, coordinates=coordinates))
        return cls(found)


def _renamed(single: xarray.Dataset, word: str) -> dict[Hashable, str]:
    """Of one estimate's dataset, what all of its variables and dimensions are called among others'."""
    names = {name: word if name == "value" else f"{word}_{name}" for name in single.data_vars}
    return names | {d: f"{d}_of_{word}" for d, n in single.sizes.items() if d != "time" or n == 1}
