"""The page of a report: one HTML text that holds its style, its program, Plotly and its data, and loads nothing."""

import json
from importlib.resources import files
from typing import Any

from maipp.errors import InputError
from maipp.viz.report_frames import Frames
from maipp.viz.report_survey import SurveyReport
from maipp.viz.report_tables import escaped, facts, kept_out, key_numbers, robot_table, summary, swatch, warnings

_PROGRAM = ("data.js", "traces.js", "maps.js", "curves.js", "controls.js")  # in this order

# The browser itself refuses whatever would be loaded from elsewhere; Plotly styles its own elements and saves
# pictures through data and blob addresses.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def plotly_program() -> str:
    """Plotly's own program, as its Python package brings it. Raises `InputError` where that is not installed."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise InputError("the interactive report needs plotly: pip install 'maipp[geo]'") from None
    return get_plotlyjs()


def page(report: SurveyReport, frames: Frames, data: dict[str, Any]) -> str:
    """The whole page."""
    title = escaped(report.title)
    program = "\n".join(_asset(name) for name in _PROGRAM)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="maipp">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
{_asset("page.css")}</style>
</head>
<body>
<header>
<h1><bdi>{title}</bdi></h1>
{facts(report)}
</header>
{warnings(report)}
<main>
<section aria-label="Key numbers">
<h2>At the end</h2>
{summary(report)}
{key_numbers(report, frames)}
</section>
<noscript><p class="notice">The maps and the time slider need JavaScript. The tables do not.</p></noscript>
<section id="survey" aria-label="Maps and curves over time">
<div id="controls" role="group" aria-label="Moment of the survey">
<button id="play" type="button" aria-label="Play"><svg viewBox="0 0 16 16" aria-hidden="true"><path/></svg></button>
<button id="back" type="button" aria-label="One step back"><svg viewBox="0 0 16 16" aria-hidden="true">\
<path d="M4 2H6V14H4ZM13 2V14L6.500 8Z"/></svg></button>
<input id="moment" type="range" min="0" max="{len(frames.times) - 1}" step="1" value="{len(frames.times) - 1}" \
aria-label="Moment of the survey">
<button id="forward" type="button" aria-label="One step forward"><svg viewBox="0 0 16 16" aria-hidden="true">\
<path d="M10 2H12V14H10ZM3 2L9.500 8L3 14Z"/></svg></button>
<output id="now" for="moment"></output>
</div>
<div id="legend">
<fieldset><legend>Robots</legend>{_robot_switches(report)}</fieldset>
<fieldset><legend>Shown</legend>{_switches(report)}</fieldset>
</div>
<div id="maps"></div>
<div id="curves"></div>
</section>
<section aria-label="Robots">
<h2>Robots</h2>
{robot_table(report)}
</section>
{kept_out(report)}
</main>
<script type="application/json" id="data">{as_json(data)}</script>
<script>{plotly_program()}</script>
<script>
"use strict";
(() => {{
{program}}})();
</script>
</body>
</html>
"""


def as_json(data: dict[str, Any]) -> str:
    """JSON in plain ASCII in which no character means anything to HTML."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _robot_switches(report: SurveyReport) -> str:
    return "".join(
        f'<label><input type="checkbox" data-robot="{index}" checked>{swatch(index)}<bdi>{escaped(name)}</bdi></label>'
        for index, name in enumerate(report.robots)
    )


def _switches(report: SurveyReport) -> str:
    """The layers that can be hidden, each with the mark that it has on the maps."""
    ring = '<circle cx="6" cy="6" r="{}" fill="{}" stroke="{}" stroke-width="{}"/>'
    marks = [
        ("routes", "routes", '<path d="M1 10L5 3L11 6" fill="none" stroke="#555" stroke-width="2"/>', True),
        ("names", "names", '<path d="M2 2H10V4H7V11H5V4H2Z" fill="#555"/>', True),
        ("measured", "measurements", ring.format(3, "#333", "#fff", 1), True),
        ("starts", "starts", ring.format(4, "#fff", "#000", 2), True),
    ]
    if report.broadcasts:
        marks.append(("told", "intents", '<ellipse cx="6" cy="6" rx="5" ry="3" fill="#5553" stroke="#555"/>', True))
    if report.prior is not None:
        marks.append(
            ("prior", "earlier samples", '<path d="M2 2L10 10M10 2L2 10" stroke="#333" stroke-width="1.500"/>', True)
        )
    return "".join(
        f'<label><input type="checkbox" data-layer="{key}"{" checked" if on else ""}>'
        f'<svg class="mark" viewBox="0 0 12 12" aria-hidden="true">{mark}</svg>{name}</label>'
        for key, name, mark, on in marks
    )


def _asset(name: str) -> str:
    return (files("maipp.viz") / "report_assets" / name).read_text(encoding="utf-8")
