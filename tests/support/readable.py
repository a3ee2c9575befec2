# SPDX-License-Identifier: Apache-2.0
"""Whether the words of a picture can be read: none lies over data, and none over another."""

import itertools

import numpy as np
from matplotlib.collections import Collection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Bbox

# Points along each piece of a line, so that none passes a text unseen; pixels by which a text may be touched.
ALONG, TOUCH = 60, 1.0


def unread(figure):
    """Unreadable parts of a figure: pairs of a text and what lies under it."""
    figure.draw_without_rendering()
    words = [text for text in words_of(figure) if text.get_visible() and text.get_text().strip()]
    boxes = {text: shrunk(text.get_window_extent()) for text in words}
    found = [f"{a.get_text()!r} over {b.get_text()!r}" for a, b in itertools.combinations(words, 2)
             if boxes[a].overlaps(boxes[b])]  # fmt: skip
    for axes in figure.axes:
        if not axes.get_visible() or axes.name == "3d":
            continue
        places = [(artist, points_of(artist, axes)) for artist in data_of(axes)]
        legend = axes.get_legend()
        for text, box in [*boxes.items(), *([(legend, legend.get_window_extent())] if legend else [])]:
            found += [
                f"{word(text)} over {artist.get_label() or artist}" for artist, points in places if inside(box, points)
            ]
    return found


def word(text):
    """A text, or a legend, in words."""
    return repr(text.get_text()) if isinstance(text, Text) else "a legend"


def words_of(figure):
    """All texts of a figure; axes in space, whose texts stand among their data, are left out."""
    found, legends = list(figure.texts), list(figure.legends)
    found += [figure._suptitle] if figure.get_suptitle() and figure._suptitle not in found else []
    for axes in figure.axes:
        if not axes.get_visible() or axes.name == "3d":
            continue
        found += [axes.title, *axes.texts]
        legends += [axes.get_legend()] if axes.get_legend() else []
        for axis in (axes.xaxis, axes.yaxis) if axes.axison else ():
            found += [axis.label, axis.offsetText, *labels_of(axis)]
    for legend in legends:
        found += [legend.get_title(), *legend.get_texts()]
    return found


def labels_of(axis):
    """The labels of an axis's ticks that are drawn: those within its limits."""
    low, high = sorted(axis.get_view_interval())
    edge, locations = 1e-9 * (high - low), axis.get_majorticklocs()
    ticks = zip(axis.get_major_ticks(len(locations)), locations, strict=True)
    return [label for tick, at in ticks if low - edge <= at <= high + edge for label in (tick.label1, tick.label2)]


def shrunk(box):
    """A box, a little smaller on all sides."""
    return Bbox.from_extents(box.x0 + TOUCH, box.y0 + TOUCH, box.x1 - TOUCH, box.y1 - TOUCH)


def data_of(axes):
    """Data that axes show: lines, marks, areas and bars, but for lines across the whole axes."""
    artists = [artist for artist in axes.get_children() if isinstance(artist, Line2D | Collection | Patch)]
    return [
        artist
        for artist in artists
        if artist.get_visible()
        and artist is not axes.patch
        and not (
            isinstance(artist, Line2D)
            and artist.get_transform() in (axes.get_xaxis_transform(), axes.get_yaxis_transform())
        )
    ]


def points_of(artist, axes):
    """Points of something drawn, on the screen, those within the axes."""
    if isinstance(artist, Line2D):
        points = along(artist.get_transform().transform(np.column_stack(artist.get_data())))
    elif isinstance(artist, Collection) and len(artist.get_offsets()) > 1:
        points = artist.get_offset_transform().transform(np.ma.filled(artist.get_offsets(), np.nan))
    elif isinstance(artist, Collection):
        points = [along(artist.get_transform().transform(path.vertices)) for path in artist.get_paths()]
        points = np.concatenate(points) if points else np.empty((0, 2))
    elif isinstance(artist, Rectangle):
        box = artist.get_window_extent()
        points = np.stack(
            np.meshgrid(*(np.linspace(*ends, ALONG) for ends in (box.intervalx, box.intervaly))), -1
        ).reshape(-1, 2)
    else:
        points = along(artist.get_transform().transform(artist.get_path().vertices))
    points = points[np.isfinite(points).all(axis=1)]
    return points[inside_of(axes.bbox, points)] if artist.get_clip_on() else points


def along(points):
    """Points on the pieces of a line (n, 2)."""
    if len(points) < 2:
        return points
    share = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    return ((1.0 - share) * points[:-1] + share * points[1:]).reshape(-1, 2)


def inside_of(box, points):
    """Mask of points (n, 2) in a box."""
    return (points >= box.min).all(axis=1) & (points <= box.max).all(axis=1)


def inside(box, points):
    """Whether some point lies in a box."""
    return bool(inside_of(box, points).any())
