"""``report.html``: all of an output on one page, in one file."""

from __future__ import annotations

from pathlib import Path

from sfm_front.reports.html import FILE
from sfm_front.reports.html.accuracy import accuracy
from sfm_front.reports.html.cameras import camera_results, cameras
from sfm_front.reports.html.distributions import reprojection_errors, track_lengths
from sfm_front.reports.html.doubts import doubts
from sfm_front.reports.html.markup import Html, joined, section, tag
from sfm_front.reports.html.match_matrix import match_matrix
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.material_reading import read_material
from sfm_front.reports.html.model_pictures import model_pictures
from sfm_front.reports.html.overlap import overlap
from sfm_front.reports.html.photo_table import photo_table
from sfm_front.reports.html.plan import plan
from sfm_front.reports.html.stage_times import stage_times
from sfm_front.reports.html.unplaced import unplaced
from sfm_front.reports.html.verdict import all_lights, as_list
from sfm_front.reports.html.workers import workers
from sfm_front.reports.lights import Light
from sfm_front.reports.verdict import verdict
from sfm_front.reports.words import clock
from sfm_front.storage.atomic import write_atomically

_STYLE = Path(__file__).with_name("page.css")
# Nothing is fetched and nothing runs, whatever a photo is called.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
# The page of a session that runs is written anew meanwhile.
_RELOAD_S = 30


def write_page(output: Path, photos: Path | None = None) -> Path:
    """Write the page of ``output`` into it; returns where. It says so if its session has not ended.

    ``photos``: the folder of the photos, if they are no longer where they were. Raises InputError
    if the output is not that of a session, or the page cannot be written.
    """
    page = as_page(read_material(output, photos))
    file = output / FILE
    write_atomically(file, lambda new: new.write(page.encode()))
    return file


def as_page(material: Material) -> str:
    """The page of what was read."""
    results = camera_results(material)
    first, model = model_pictures(material) or (None, None)
    sections = [
        model,
        _places(material),
        unplaced(material),
        cameras(material, results),
        _matches(material),
        _time(material),
        workers(material),
        doubts(material),
        photo_table(material),
    ]
    title = f"{material.name} – reconstruction report"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("meta", http_equiv="refresh", content=_RELOAD_S) if material.is_running else None,
        tag("title", title),
        tag("style", Html(_STYLE.read_text(encoding="utf-8"))),
    )
    start = _first_screen(material, all_lights(material), first)
    main = tag("main", start, joined(sections))
    body = tag("body", main, tag("footer", _origin(material)))
    return f"<!DOCTYPE html>\n{tag('html', head, body, lang='en')}\n"


def _first_screen(material: Material, found: list[Light], model: Html | None) -> Html:
    return tag(
        "header",
        tag("p", _origin(material), class_="origin"),
        tag("h1", material.name),
        _how_it_stands(material),
        tag("p", _sentence(material), class_="verdict"),
        _figures(material),
        tag(
            "div",
            as_list(found),
            model,
            class_="first",
        ),
    )


def _how_it_stands(material: Material) -> Html | None:
    words, command = material.how_it_stands, material.command
    if not words:
        return None
    return tag("p", words, " ", tag("code", command) if command else None, class_="so-far")


def _sentence(material: Material) -> str:
    if not (material.is_finished or material.models):
        return "There is no model yet."
    return verdict(material.summary, material.sidecar).sentence


def _figures(material: Material) -> Html:
    """The result in numbers, large."""
    totals, models = material.summary.totals, material.summary.models
    error = totals.mean_reprojection_error_px
    used = max(totals.num_used, 1)
    tiles = [
        (f"{totals.num_registered} / {totals.num_used}", "photos registered"),
        (str(len(models)), "model" if len(models) == 1 else "models"),
        (f"{totals.num_points:,}".replace(",", "\N{NARROW NO-BREAK SPACE}"), "points"),
        ("–" if error is None else f"{error:.2f} px", "mean reprojection error"),
        (f"{models[0].mean_track_length:.1f}" if models else "–", "photos a point"),
        (clock(totals.wall_seconds), f"wall time, {totals.wall_seconds / used:.1f} s a photo"),
    ]
    return tag(
        "ul",
        joined(tag("li", tag("b", value), tag("span", name)) for value, name in tiles),
        class_="tiles",
    )


def _places(material: Material) -> Html | None:
    if material.observations is None:
        return None
    found = accuracy(material)
    drawings = joined([plan(material), overlap(material)])
    return section(
        "map",
        "Where the photos are",
        tag("div", drawings, class_="columns"),
        None if found is None else tag("div", tag("h3", "Accuracy"), found, class_="accuracy"),
    )


def _matches(material: Material) -> Html | None:
    observations = material.observations
    has_points = observations is not None and len(observations.point)
    parts = [match_matrix(material)]
    if observations is not None and has_points:
        charts = joined([track_lengths(observations), reprojection_errors(observations)])
        parts.append(tag("div", charts, class_="stack"))
    if not any(parts):
        return None
    return section("matches", "Matches and points", tag("div", joined(parts), class_="columns"))


def _time(material: Material) -> Html | None:
    chart = stage_times(material)
    if chart is None:
        return None
    at_end = ", ".join(
        f"{stage} {seconds:.1f} s" for stage, seconds in material.summary.end_seconds.items()
    )
    events = [tag("li", event) for event in material.summary.end_events]
    return section(
        "time",
        "Time",
        chart,
        tag("p", f"At the end: {at_end}.", class_="note") if at_end else None,
        tag("details", tag("summary", "What happened to the models"), tag("ol", joined(events)))
        if events
        else None,
    )


def _origin(material: Material) -> str:
    began = f", {material.began} UTC" if material.began else ""
    return f"sfm-front {material.version}{began}"
