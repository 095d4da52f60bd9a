"""What is drawn on a map of the survey area: fields, areas, routes, obstacles, in the file's coordinates."""

import math
from typing import Any

import numpy as np
import shapely
from contourpy import contour_generator
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from maipp.engine.episode import Episode
from maipp.roadmap import Obstacles
from maipp.typing import Float
from maipp.viz.style import (
    AREA_COLOUR,
    GREY,
    MEDIUM,
    OBSTACLE_COLOUR,
    OUTLINE_COLOUR,
    SMALL,
    agent_colour,
    agent_line,
    halo,
)

_OBSTACLE_LOOK: dict[str, Any] = {"facecolor": "#DDDDDD", "edgecolor": OBSTACLE_COLOUR, "lw": 0.8, "hatch": "////"}
_PRIOR_LOOK: dict[str, Any] = {"ls": "", "marker": "+", "ms": 4.0, "mec": GREY, "mew": 0.8}

# What is drawn on top of what.
FIELD, AREA, OBSTACLE, ROUTE, MARKER = 0, 1, 2, 3, 4


def map_size(episode: Episode, area: float, longest: float) -> tuple[float, float]:
    """Width and height (inches) of a map of about `area` square inches with the domain's proportions."""
    width, height = episode.scenario.extent
    scale = min(math.sqrt(area / (width * height)), longest / max(width, height))
    return max(width * scale, 1.0), max(height * scale, 1.0)


def corners(episode: Episode) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Lower left and upper right corner of the domain, file coordinates."""
    return episode.drawn.to_user(np.zeros(2)), episode.drawn.to_user(np.array(episode.scenario.extent))


def prepare_map(axes: Axes, episode: Episode, title: str, *, x_label: bool = True, y_label: bool = True) -> None:
    """Limits, proportions, labels and obstacles of a map."""
    low, high = corners(episode)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect(episode.drawn.aspect)
    axes.set_title(title, fontsize=MEDIUM, loc="left", pad=4)
    for axis, shown, label in (
        (axes.xaxis, x_label, episode.drawn.x_name),
        (axes.yaxis, y_label, episode.drawn.y_name),
    ):
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        axis.set_tick_params(labelbottom=shown, labelleft=shown)
        if shown:
            axis.set_label_text(label, fontsize=SMALL)
    axes.ticklabel_format(useOffset=False, style="plain")
    draw_obstacles(axes, episode)
    draw_prior(axes, episode)


def draw_obstacles(axes: Axes, episode: Episode) -> None:
    """The no-go zones, hatched; those that touch are one, without the sides that they share."""
    if not episode.scenario.obstacles:
        return
    for part in shapely.get_parts(Obstacles(episode.scenario.obstacles).union):
        rings = (
            Path(episode.drawn.to_user(np.asarray(ring.coords)), closed=True)
            for ring in (part.exterior, *part.interiors)
        )
        axes.add_patch(PathPatch(Path.make_compound_path(*rings), zorder=OBSTACLE, **_OBSTACLE_LOOK))


def draw_prior(axes: Axes, episode: Episode) -> None:
    """The samples taken before the survey as small crosses; the more there are, the smaller."""
    if episode.prior is not None:
        places = episode.drawn.to_user(np.asarray(episode.prior.x))
        size = min(_PRIOR_LOOK["ms"], max(1.5, 40.0 / math.sqrt(len(places))))
        axes.plot(*places.T, path_effects=halo(1.6), zorder=OBSTACLE + 0.5, **(_PRIOR_LOOK | {"ms": size}))


def as_picture(episode: Episode, values: np.ndarray) -> np.ndarray:
    """Grid values (q,) as rows of ascending y."""
    side = episode.scenario.grid
    return values.reshape(side, side).T


def draw_field(
    axes: Axes, episode: Episode, values: Float[np.ndarray, " q"], colours: str, limits: tuple[float, float]
) -> AxesImage:
    """The values on the grid (file units), smoothed between grid points."""
    low, high = corners(episode)
    half = (high - low) / (episode.scenario.grid - 1) / 2  # grid points are the centres of pixels
    return axes.imshow(
        as_picture(episode, values),
        origin="lower",
        extent=(low[0] - half[0], high[0] + half[0], low[1] - half[1], high[1] + half[1]),
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        aspect=episode.drawn.aspect,
        interpolation="bilinear",
        zorder=FIELD,
    )


def area_outline(axes: Axes, episode: Episode, surplus: Float[np.ndarray, " q"], *, filled: bool = False) -> None:
    """The region where `surplus` is not negative, as an outline or filled."""
    picture = as_picture(episode, surplus)
    if picture.max() < 0 or (not filled and picture.min() >= 0):
        return  # Matplotlib warns where there is nothing to draw
    x, y = _grid_lines(episode)
    if filled:
        axes.contourf(x, y, picture, levels=[0.0, math.inf], colors=[AREA_COLOUR], zorder=AREA)
    else:
        axes.contour(x, y, picture, levels=[0.0], colors=[OUTLINE_COLOUR], linewidths=1.0, zorder=AREA)


def outline_paths(episode: Episode, surplus: Float[np.ndarray, "k q"]) -> list[Path]:
    """The outline of the region where each row of `surplus` is not negative, file coordinates."""
    x, y = _grid_lines(episode)
    paths = []
    for row in surplus:
        lines = contour_generator(x, y, as_picture(episode, row), line_type="Separate").lines(0.0)
        paths.append(Path.make_compound_path(*(Path(np.asarray(line)) for line in lines)))
    return paths


def _grid_lines(episode: Episode) -> list[Float[np.ndarray, " g"]]:
    """x and y of the grid's columns and rows, file coordinates."""
    low, high = corners(episode)
    return [np.linspace(low[axis], high[axis], episode.scenario.grid) for axis in (0, 1)]


def draw_routes(axes: Axes, episode: Episode) -> None:
    """Routes with their measurements, starts and ends."""
    for index, agent in enumerate(episode.agents):
        colour, route = agent_colour(index), episode.drawn.to_user(agent.route)
        spots = episode.drawn.to_user(agent.measurement_x)
        axes.plot(*route.T, color=colour, ls=agent_line(index), lw=1.4, path_effects=halo(2.3), zorder=ROUTE)
        axes.plot(*spots.T, ls="", marker="o", ms=3.0, mfc=colour, mec="white", mew=0.5, zorder=ROUTE + 0.1)
        axes.plot(*route[-1], marker="s", ms=5.5, mfc=colour, mec="black", mew=0.8, zorder=MARKER)
    for start in {tuple(episode.drawn.to_user(agent.start)) for agent in episode.agents}:
        axes.plot(*start, marker="o", ms=6.5, mfc="white", mec="black", mew=1.2, zorder=MARKER)


def legend_of(episode: Episode) -> list[Line2D | Patch]:
    """Legend entries for everything that `draw_routes` and `prepare_map` draw."""
    entries: list[Line2D | Patch] = [
        Line2D([], [], color=agent_colour(i), ls=agent_line(i), lw=1.6, label=f"agent {i}")
        for i in range(len(episode.agents))
    ]
    marker: dict[str, Any] = {"ls": "", "mec": "black"}
    entries += [
        Line2D([], [], marker="o", ms=6, mfc="white", mew=1.2, label="start", **marker),
        Line2D([], [], marker="s", ms=5, mfc=GREY, mew=0.8, label="end", **marker),
        Line2D([], [], marker="o", ms=3.5, mfc=GREY, ls="", mec="white", mew=0.4, label="measurement"),
    ]
    if episode.prior is not None:
        entries.append(Line2D([], [], label="prior sample", **_PRIOR_LOOK))
    if episode.scenario.obstacles:
        entries.append(Patch(label="obstacle", **_OBSTACLE_LOOK))
    return entries


def colour_bar(figure: Figure, axes: Axes, image: AxesImage, label: str, mark: float | None = None) -> Colorbar:
    """A colour bar in `axes`, with a line at `mark`."""
    bar = figure.colorbar(image, cax=axes)
    bar.set_label(label if mark is None else f"{label} (line: threshold)", fontsize=SMALL)
    bar.outline.set_linewidth(0.6)  # type: ignore[operator]  # a Spine, which Matplotlib does not declare
    bar.ax.tick_params(labelsize=SMALL, width=0.6, length=2.5, color=GREY)
    low, high = image.get_clim()
    if mark is not None and low < mark < high:
        bar.ax.axhline(mark, color="white", lw=2.4)
        bar.ax.axhline(mark, color="black", lw=1.2)
    return bar


def legend_below(figure: Figure, entries: list[Any], left: float) -> None:
    """Add the legend at the lower left corner, `left` inches from the border."""
    width, height = figure.get_size_inches()
    figure.legend(
        handles=entries,
        loc="lower left",
        bbox_to_anchor=(left / width, 0.1 / height),
        ncols=min(len(entries), 8),
        fontsize=SMALL,
        frameon=False,
        borderaxespad=0.0,
        columnspacing=1.4,
        handlelength=1.6,
    )
