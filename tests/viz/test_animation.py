"""The film shows, at every frame, what was known and where everybody was at that moment."""

import dataclasses
import os

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

from maipp.belief import PriorSamples
from maipp.viz.animation import Film, save_animation

WORKING = '#!/bin/sh\ncat > /dev/null\nfor last; do :; done\nprintf film > "$last"\n'
BROKEN = "#!/bin/sh\necho no encoder >&2\nexit 1\n"


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """Puts an ffmpeg with this text first on the path."""

    def put(text):
        folder = tmp_path / "bin"
        folder.mkdir()
        (folder / "ffmpeg").write_text(text)
        (folder / "ffmpeg").chmod(0o755)
        monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")

    return put


def points_in(axes):
    return np.concatenate([np.asarray(line.get_xydata()) for line in axes.lines])


def picture_in(axes) -> np.ndarray:
    return np.asarray(axes.images[0].get_array())


def test_frames_show_the_belief_the_agents_and_the_trace_of_their_time(episode):
    film = Film(episode, frames=5, dpi=40)
    mean_map, std_map, curve = film.figure.axes
    assert film.times[0] == 0.0 and film.times[-1] == pytest.approx(episode.end)
    for frame, time in enumerate(film.times):
        film.show(frame)
        belief = episode.beliefs(np.array([time + 1e-5]))
        np.testing.assert_allclose(picture_in(mean_map), belief.mean[0].reshape(9, 9).T, atol=1e-5)
        np.testing.assert_allclose(picture_in(std_map), np.sqrt(belief.variance[0]).reshape(9, 9).T, atol=1e-3)
        measured = sum((agent.measurement_time <= time + 1e-5).sum() for agent in episode.agents)
        for axes in (mean_map, std_map):
            *_, dots = axes.lines
            assert len(np.asarray(dots.get_xdata())) == measured
            for place in episode.positions(np.array([time]))[:, 0]:
                assert np.isclose(points_in(axes), place, atol=1e-6).all(axis=1).any()
        assert np.asarray(curve.lines[-1].get_ydata())[0] == pytest.approx(belief.trace[0], rel=1e-4)


def test_a_film_begins_with_what_prior_samples_tell(episode):
    prior = PriorSamples(np.array([[0.25, 0.25]], np.float32), np.array([0.9], np.float32))
    film = Film(dataclasses.replace(episode, prior=prior), frames=3, dpi=40)
    film.show(0)
    for axes in film.figure.axes[:2]:
        (crosses,) = [line for line in axes.lines if line.get_marker() == "+"]
        np.testing.assert_array_equal(crosses.get_xydata(), prior.x)
    mean_map, std_map, _ = film.figure.axes
    assert picture_in(mean_map)[4, 2] == pytest.approx(0.9, abs=1e-3)  # the sample lies on the grid
    assert picture_in(std_map)[4, 2] < 0.01 and picture_in(std_map)[0, 8] > 0.5


def test_a_mapped_film_is_in_the_file_s_coordinates(episode, mapping):
    film = Film(dataclasses.replace(episode, reference=mapping), frames=3, dpi=40)
    film.show(2)
    mean_map = film.figure.axes[0]
    np.testing.assert_allclose(mean_map.get_xlim(), (10.0, 12.0))
    points = points_in(mean_map)
    assert (points >= [10.0, 60.0]).all() and (points <= [12.0, 60.5]).all()
    np.testing.assert_allclose(picture_in(mean_map).max(), 30.0, atol=8.0)


def test_without_ffmpeg_it_is_a_gif(episode, tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    shown = []
    path = save_animation(episode, tmp_path / "mission", lambda done, total: shown.append((done, total)), frames=4)
    assert path == str(tmp_path / "mission.gif")
    with Image.open(path) as film:
        assert getattr(film, "n_frames", 1) >= 4  # the held last frame may be stored once
        assert min(film.size) > 100
    assert [done for done, _ in shown] == list(range(1, shown[0][1] + 1))
    assert [item.name for item in tmp_path.iterdir()] == ["mission.gif"]


def test_with_ffmpeg_it_is_an_mp4(episode, tmp_path, ffmpeg):
    ffmpeg(WORKING)
    assert save_animation(episode, tmp_path / "mission", frames=2) == str(tmp_path / "mission.mp4")
    assert (tmp_path / "mission.mp4").read_text() == "film"


def test_with_an_ffmpeg_that_cannot_it_is_a_gif_after_all(episode, tmp_path, ffmpeg):
    ffmpeg(BROKEN)
    assert save_animation(episode, tmp_path / "mission", frames=2) == str(tmp_path / "mission.gif")
    assert sorted(item.name for item in tmp_path.iterdir()) == ["bin", "mission.gif"]
