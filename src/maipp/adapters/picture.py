"""The survey of an environment as it stands: a picture, a window or a text."""

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from maipp.engine.episode import Episode
from maipp.viz.maps import area_outline, draw_field, prepare_map
from maipp.viz.style import STD_MAP, VALUE_MAP, agent_colour, agent_line, halo

_DPI = 100


def travelled(episode: Episode, time: float) -> list[np.ndarray]:
    """The route of each agent until a time, its place at that time last: (v, 2) each, domain units."""
    places = episode.positions(np.array([time]))[:, 0]
    return [
        np.concatenate([agent.route[agent.route_time <= time], places[i][None]])
        for i, agent in enumerate(episode.agents)
    ]


def _paint(figure: Figure, episode: Episode, time: float) -> None:
    """Predicted mean with the high-interest area, and predicted standard deviation, with the routes so far."""
    figure.clear()
    belief = episode.beliefs(np.array([time]))
    mean_axes, std_axes = figure.subplots(1, 2)
    spread = float(np.sqrt(episode.scenario.signal_variance))
    draw_field(mean_axes, episode, belief.mean[0], VALUE_MAP, (0.0, 1.0))
    area_outline(mean_axes, episode, episode.surplus(belief.bound[0]))
    draw_field(std_axes, episode, np.sqrt(belief.variance[0]), STD_MAP, (0.0, spread))
    titles = (f"Predicted mean, t = {time:.2f}", f"Standard deviation, Tr(P) = {belief.trace[0]:.3g}")
    for axes, title in zip((mean_axes, std_axes), titles, strict=True):
        prepare_map(axes, episode, title)
        for index, route in enumerate(travelled(episode, time)):
            colour = agent_colour(index)
            axes.plot(*route.T, color=colour, ls=agent_line(index), lw=1.4, path_effects=halo(2.3))
            axes.plot(*route[-1], marker="o", ms=6, mfc=colour, mec="black", mew=0.8)


def draw_survey(episode: Episode, time: float) -> np.ndarray:
    """The survey at a time, RGB (h, w, 3) uint8."""
    figure = Figure(figsize=(8.0, 4.2), dpi=_DPI, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    _paint(figure, episode, time)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def show(figure: Any, episode: Episode, time: float) -> Any:
    """Draw the survey at a time into a window, a new one where `figure` is None; the figure."""
    from matplotlib import pyplot

    if figure is None:
        figure = pyplot.figure(figsize=(8.0, 4.2), layout="constrained")
    _paint(figure, episode, time)
    figure.canvas.draw_idle()
    figure.canvas.flush_events()
    if figure.canvas.manager is not None and pyplot.get_backend().lower() != "agg":
        pyplot.show(block=False)
    return figure


def as_text(episode: Episode, time: float) -> str:
    """One line for the survey at a time and one for each agent; domain units."""
    belief = episode.beliefs(np.array([time]))
    places = episode.positions(np.array([time]))[:, 0]
    lines = [f"time {time:.3f}  Tr(P) {belief.trace[0]:.4g}"]
    for index, agent in enumerate(episode.agents):
        measured = int((agent.measurement_time <= time).sum())
        x, y = places[index]
        lines.append(f"robot_{index}  at ({x:.3f}, {y:.3f})  {measured} measurements")
    return "\n".join(lines) + "\n"
