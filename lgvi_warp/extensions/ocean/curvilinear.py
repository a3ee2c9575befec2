# SPDX-License-Identifier: Apache-2.0
"""Fractional indices of points along y and x, in a grid of cells with four corners such as a rotated or a curved grid.

Newton's method inverts the bilinear map of the cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Cells are looked through until a place is in one; a smooth grid needs a few steps.
MOST_STEPS = 60


@dataclass(frozen=True, eq=False)
class CurvedGrid:
    """Nodes of a grid in metres to the north and the east, (y, x) each. known: Mask of nodes with data; None for all nodes.

    The search for a point begins in a cell between known nodes.
    """

    north: np.ndarray
    east: np.ndarray
    known: np.ndarray | None = None

    def fractions(self, north: np.ndarray, east: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Fractional row and column indices (...) of points, also beyond the grid.

        A cell is bilinear in its corners. Newton's method begins in the cell with the nearest centre and may change cells.
        """
        places = np.stack([np.ravel(north), np.ravel(east)], axis=-1)
        row, column = self._nearest_cells(places)
        at = np.stack([row + 0.5, column + 0.5], axis=-1)
        scale = np.max(np.abs(places), initial=1.0)
        for _ in range(MOST_STEPS):
            cell, corners = self._cells(at)
            part = at - cell
            value, slopes = _bilinear(corners, part)
            off = value - places
            if np.max(np.abs(off), initial=0.0) < 1e-12 * scale:
                break
            # At most one and a half cells at a time.
            at = at - np.clip(np.linalg.solve(slopes, off[..., None])[..., 0], -1.5, 1.5)
        shape = np.shape(north)
        return at[:, 0].reshape(shape), at[:, 1].reshape(shape)

    def directions(self, axis: int) -> np.ndarray:
        """Unit vectors (y, x, 2), north and east, at the nodes along rising rows (axis 0) or columns (axis 1)."""
        along = np.stack([np.gradient(x, axis=axis) for x in (self.north, self.east)], axis=-1)
        return np.asarray(along / np.linalg.norm(along, axis=-1, keepdims=True))

    def _nearest_cells(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        from scipy.spatial import cKDTree

        middles = [0.25 * (x[1:, 1:] + x[1:, :-1] + x[:-1, 1:] + x[:-1, :-1]) for x in (self.north, self.east)]
        known = np.ones(self.north.shape, bool) if self.known is None else self.known
        cells = np.flatnonzero(known[1:, 1:] & known[1:, :-1] & known[:-1, 1:] & known[:-1, :-1])
        cells = cells if len(cells) else np.arange(middles[0].size)
        _, nearest = cKDTree(np.stack([x.ravel()[cells] for x in middles], axis=-1)).query(places)
        row, column = np.divmod(cells[nearest], middles[0].shape[1])
        return row, column

    def _cells(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First corner (n, 2) of the cell at or nearest to a point, and its corners (n, 2, 2, 2): y, x, coordinate."""
        most = np.array(self.north.shape) - 2
        cell = np.clip(np.floor(at).astype(int), 0, most)
        j, i = cell[:, 0], cell[:, 1]
        nodes = np.stack([self.north, self.east], axis=-1)
        corners = np.stack([np.stack([nodes[j + a, i + b] for b in (0, 1)], axis=1) for a in (0, 1)], axis=1)
        return cell, corners


def _bilinear(corners: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 2) at fractions of cells, and their derivatives (n, 2, 2) along y and along x."""
    y, x = part[:, 0, None], part[:, 1, None]
    first, second = corners[:, 0], corners[:, 1]
    along_x = (first[:, 1] - first[:, 0], second[:, 1] - second[:, 0])
    low, high = first[:, 0] + x * along_x[0], second[:, 0] + x * along_x[1]
    slopes = np.stack([high - low, along_x[0] + y * (along_x[1] - along_x[0])], axis=-1)
    return low + y * (high - low), slopes
