"""The survey as it went on: predicted mean and std with the agents moving over them, and Tr(P) over time."""

import os
import subprocess
from collections.abc import Callable

import numpy as np
from matplotlib import colormaps
from matplotlib.animation import FFMpegWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.path import Path
from matplotlib.ticker import LogFormatter
from PIL import Image

from maipp.engine.episode import Episode
from maipp.errors import InputError
from maipp.files import atomic_path
from maipp.typing import Float
from maipp.viz.captions import headline
from maipp.viz.maps import (
    AREA,
    MARKER,
    ROUTE,
    as_picture,
    colour_bar,
    draw_field,
    draw_obstacles,
    draw_prior,
    map_size,
    outline_paths,
    prepare_map,
)
from maipp.viz.style import (
    GREY,
    LARGE,
    MEDIUM,
    OUTLINE_COLOUR,
    SMALL,
    STD_MAP,
    VALUE_MAP,
    add_axes,
    agent_colour,
    agent_line,
    bare_axes,
    halo,
    new_figure,
)

_DPI = 80
_FRAMES = 52  # moving ones
_HELD = 8  # times the last one is shown
_PER_SECOND = 10
_SHADES, _GREYS = 108, 24  # of each map and of text, in the palette of a gif
_INSTANT = 1e-5  # times this close are the same

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.6, 0.65, 0.65, 0.45  # margins, inches
_BAR_GAP, _BAR, _GAP_X, _GAP_Y, _CURVE = 0.08, 0.12, 0.95, 0.6, 1.2

Progress = Callable[[int, int], None]  # frames done, frames in all


class _Map:
    """One map of the film: a field, the outline of the high-interest area, and the agents on their way."""

    def __init__(self, axes: Axes, image: AxesImage, episode: Episode) -> None:
        self._image, self._episode = image, episode
        self._routes = [episode.drawn.to_user(agent.route) for agent in episode.agents]
        self._spots = episode.drawn.to_user(np.concatenate([agent.measurement_x for agent in episode.agents]))
        self._spot_times = np.concatenate([agent.measurement_time for agent in episode.agents])
        self._outline = axes.add_collection(PathCollection([], facecolor="none", lw=1.0, zorder=AREA), autolim=False)
        self._outline.set_edgecolor(OUTLINE_COLOUR)
        self._outline.set_path_effects(halo(2.2))
        self._trails, self._here = [], []
        for index in range(len(self._routes)):
            colour = agent_colour(index)
            style = {"color": colour, "ls": agent_line(index), "lw": 1.3, "path_effects": halo(2.2)}
            self._trails += axes.plot([], [], zorder=ROUTE, **style)
            self._here += axes.plot([], [], marker="o", ms=6, mfc=colour, mec="black", mew=0.8, zorder=MARKER)
        (self._dots,) = axes.plot([], [], ls="", marker="o", ms=2.6, mfc=GREY, mec="white", mew=0.4, zorder=ROUTE + 0.1)

    def update(
        self, values: Float[np.ndarray, " q"], outline: Path, places: Float[np.ndarray, "m 2"], time: float
    ) -> None:
        """Move everything to `time`."""
        self._image.set_data(as_picture(self._episode, values))
        self._outline.set_paths([outline])
        for agent, route, trail, here, place in zip(
            self._episode.agents, self._routes, self._trails, self._here, places, strict=True
        ):
            trail.set_data(*np.concatenate([route[agent.route_time < time], place[None]]).T)
            here.set_data(*place[:, None])
        self._dots.set_data(*self._spots[self._spot_times <= time + _INSTANT].T)


class _Backdrop(Artist):
    """Pixels that are put behind everything else as they are."""

    def __init__(self, figure: Figure) -> None:
        super().__init__()
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        self._pixels = canvas.copy_from_bbox(figure.bbox)
        self.set_zorder(-1)

    def draw(self, renderer: RendererBase) -> None:
        """Put them there."""
        renderer.restore_region(self._pixels)  # pyright: ignore[reportAttributeAccessIssue]


class Film:
    """The figure of the animation; `show` moves what changes.

    What stands still (ticks, labels, colour bars) costs most to draw: it is drawn once, and is a picture behind.
    """

    def __init__(self, episode: Episode, frames: int = _FRAMES, dpi: int = _DPI) -> None:
        self.episode = episode
        self.times = np.linspace(0.0, max(episode.end, 1e-9), frames)
        there = episode.drawn
        belief = episode.beliefs(self.times + _INSTANT)  # what is measured at an instant is known in its frame
        self._means, self._stds = there.to_user_values(belief.mean), there.to_user_std(np.sqrt(belief.variance))
        self._outlines = outline_paths(episode, episode.surplus(belief.bound))
        self._places = there.to_user(episode.positions(self.times))

        width, height = map_size(episode, area=8.0, longest=4.0)
        up, right = _BOTTOM + _CURVE + _GAP_Y, _LEFT + width + _BAR_GAP + _BAR + _GAP_X
        whole = (right + width + _BAR_GAP + _BAR + _RIGHT, up + height + _TOP)
        backdrop, self.figure = new_figure(*whole, dpi), new_figure(*whole, dpi)
        shown = np.concatenate([there.to_user_values(episode.truth), self._means[-1]])
        threshold = float(there.to_user_values(episode.scenario.threshold))
        self._maps = []
        value, shown_values = there.value_name, (float(shown.min()), float(shown.max()))
        for left, title, colours, limits, label, mark in (
            (_LEFT, "Predicted mean, high-interest area", VALUE_MAP, shown_values, value, threshold),
            (right, "Predicted standard deviation", STD_MAP, (0.0, float(self._stds.max())), f"std of {value}", None),
        ):
            axes = add_axes(backdrop, left, up, width, height)
            image = draw_field(axes, episode, self._means[0], colours, limits)
            prepare_map(axes, episode, title, y_label=left == _LEFT)
            bar = add_axes(backdrop, left + width + _BAR_GAP, up, _BAR, height)
            colour_bar(backdrop, bar, image, label, mark)
            axes = bare_axes(self.figure, axes)
            image = draw_field(axes, episode, self._means[0], colours, limits)
            draw_obstacles(axes, episode)
            draw_prior(axes, episode)
            self._maps.append(_Map(axes, image, episode))
        axes = add_axes(backdrop, _LEFT, _BOTTOM, whole[0] - _LEFT - _RIGHT, _CURVE)
        self._prepare_curve(axes)
        axes = bare_axes(self.figure, axes)
        (self._curve,) = axes.plot([], [], color=OUTLINE_COLOUR, lw=1.3, drawstyle="steps-post")
        (self._now,) = axes.plot([], [], marker="o", ms=5, mfc=OUTLINE_COLOUR, mec="white", mew=0.8)
        left, top = _LEFT / whole[0], 1 - 0.12 / whole[1]
        backdrop.text(left, top, headline(episode), fontsize=LARGE, weight="bold", va="top")
        self._text = self.figure.text(1 - _RIGHT / whole[0], top, "", fontsize=MEDIUM, color=GREY, va="top", ha="right")
        self.figure.add_artist(_Backdrop(backdrop), clip=False)

    def show(self, frame: int) -> Figure:
        """The figure at this frame."""
        time = self.times[frame]
        for panel, pictures in zip(self._maps, (self._means, self._stds), strict=True):
            panel.update(pictures[frame], self._outlines[frame], self._places[:, frame], time)
        times, traces = self.episode.metrics.curve_time, self.episode.metrics.curve_trace
        past = times <= time + _INSTANT
        self._curve.set_data(np.append(times[past], time), np.append(traces[past], traces[past][-1]))
        self._now.set_data([time], [traces[past][-1]])
        self._text.set_text(f"time {time:.2f}   Tr(P) = {traces[past][-1]:.3g}")
        return self.figure

    def picture(self, frame: int) -> np.ndarray:
        """The pixels of this frame (rows, columns, rgb), 8 bits each."""
        canvas = self.show(frame).canvas
        assert isinstance(canvas, FigureCanvasAgg)
        canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3]

    def _prepare_curve(self, axes: Axes) -> None:
        """Limits, labels and grid of the plot of Tr(P) over time."""
        traces = self.episode.metrics.curve_trace
        low, high = max(float(traces.min()), 1e-6), max(float(traces.max()), 1e-5)
        axes.set_yscale("log")
        axes.set(xlim=(0.0, self.times[-1]), ylim=(low / 1.3, high * 1.3))
        axes.set_title("Tr(P) of the pooled belief", fontsize=MEDIUM, loc="left", pad=4)
        axes.set_xlabel("time", fontsize=SMALL)
        axes.yaxis.set_major_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
        axes.grid(which="major", color="#DDDDDD", lw=0.6)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)


def save_animation(
    episode: Episode, stem: str | os.PathLike[str], progress: Progress | None = None, *, frames: int = _FRAMES
) -> str:
    """Write the film to `stem`.mp4 where there is an ffmpeg that can, else to `stem`.gif; returns the path.

    Raises `InputError` where the file cannot be written.
    """
    film = Film(episode, frames)
    if FFMpegWriter.isAvailable():
        try:
            return _write_mp4(film, f"{stem}.mp4", progress)
        except (subprocess.CalledProcessError, InputError):
            pass  # an ffmpeg that does not start, or lacks the H.264 encoder; a gif needs no help
    return _write_gif(film, f"{stem}.gif", progress)


def _write_mp4(film: Film, path: str, progress: Progress | None) -> str:
    """Every frame into `path`, the last one held."""
    count, writer = len(film.times), FFMpegWriter(fps=_PER_SECOND)
    with atomic_path(path) as temporary, writer.saving(film.figure, temporary, film.figure.dpi):
        for number in range(count + _HELD):
            film.show(min(number, count - 1))
            writer.grab_frame()
            if progress is not None:
                progress(number + 1, count + _HELD)
    return path


def _write_gif(film: Film, path: str, progress: Progress | None) -> str:
    """The same; all frames have one palette: to find one for each takes as long as to draw it."""
    count, pictures, palette = len(film.times), list[Image.Image](), Image.new("P", (1, 1))
    palette.putpalette(_colours(len(film.episode.agents)).tobytes())
    for number in range(count):
        picture = Image.fromarray(film.picture(number))
        pictures.append(picture.quantize(palette=palette, dither=Image.Dither.NONE))
        if progress is not None:
            progress(number + 1, count)
    shown = [1000 // _PER_SECOND] * (count - 1) + [1000 // _PER_SECOND * (_HELD + 1)]  # ms
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, "GIF", save_all=True, append_images=pictures[1:], duration=shown, loop=0)
    return path


def _colours(agents: int) -> np.ndarray:
    """The palette of a gif (at most 256, 3), 8 bits each: the colours of both maps, greys, and those of the agents."""
    greys = np.linspace(0, 1, _GREYS)
    maps = [colormaps[name](np.linspace(0, 1, _SHADES))[:, :3] for name in (VALUE_MAP, STD_MAP)]
    own = np.array([to_rgb(agent_colour(index)) for index in range(min(agents, 256 - _GREYS - 2 * _SHADES))])
    return np.round(255 * np.concatenate([np.repeat(greys[:, None], 3, axis=1), *maps, own])).astype(np.uint8)
