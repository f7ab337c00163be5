"""The whole page: what is on it, what is left out, and that no name does harm."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from helpers.report_making import HINT, METRIC, WHY_NOT, Output, finished_output

from sfm_front.errors import InputError
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import (
    ControlAccuracy,
    MarkResidual,
    PointResidual,
    PointRole,
)
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.html.page import write_page
from sfm_front.types import SkipReason

HOSTILE = (
    "<img src=x onerror=alert(1)>.jpg",
    "</title><script>alert(2)</script>.jpg",
    "\"' onload=alert(3) x='.jpg",
    "esc\x1b]0;title\x07\u202e.jpg",
    "&lt;b&gt;.jpg",
)


class Reader(HTMLParser):
    """Collects tags with their attributes, and text outside style sheets."""

    VOID = ("img", "meta", "br")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data

    @property
    def sections(self) -> set[str | None]:
        return {attributes["id"] for tag, attributes in self.tags if tag == "section"}


def page_of(folder, **output) -> str:
    return write_page(finished_output(folder, Output(**output))).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def full(tmp_path_factory) -> str:
    output = tmp_path_factory.mktemp("full") / "flight"
    return page_of(output, skipped={"copy.jpg": SkipReason.DUPLICATE}, is_doubtful=True)


def test_all_parts_are_there(full):
    read = Reader(full)
    assert not read.open
    parts = {"model", "map", "unplaced", "cameras", "matches", "time", "doubts", "photos"}
    assert read.sections == parts
    for words in (
        "8 of 9 photos are in one model, in metres",
        "CE90",
        "LE90",
        "far off.jpg",
        "at latitude and longitude 0",
        "4.56 cm/px",
        "1.23 ha",
        "north is up",
        "Arrows point to the measured positions",
        "1 not in it, where their positions have them",
        "How many photos see a place",
        "mean residual by place on the photo",
        "inliers in the median pair",
        "Track length",
        "Reprojection error",
        "Milliseconds a photo",
        "most relevant image: 000007.jpg",
        "duplicate",
        "doubtful",
        "Taken for one place and taken apart",
        WHY_NOT,
        HINT,
    ):
        assert words in read.text, words


CHECK = PointResidual(
    "<q>",
    PointRole.CHECKPOINT,
    0.11,
    -0.22,
    None,
    (MarkResidual("a.jpg", 1.0, 0.0, True), MarkResidual("b.jpg", 9.0, 9.0, False)),
)
CONTROL = ControlReport(
    file="gcp_list.txt",
    model=0,
    missing_photos=("elsewhere.jpg",),
    points=(CHECK,),
    control=ControlAccuracy(4, 0.01, 0.02, 0.03, 0.04, 0.05),
    checkpoints=ControlAccuracy(1, 0.11, 0.22, None, 0.246, None),
)


def test_control_points_are_listed(tmp_path):
    text = Reader(page_of(tmp_path / "out", sidecar=replace(METRIC, control_points=CONTROL))).text
    for words in (
        "gcp_list.txt",
        "<q>",
        "-0.220",
        "b.jpg",
        "0.246",
        "elsewhere.jpg",
        "1 checkpoint",
    ):
        assert words in text, words


def test_control_points_that_are_not_used_are_said_to_be(tmp_path):
    unused = ControlReport(file="gcp_list.txt", not_used="line 7 is wrong")
    page = page_of(tmp_path / "out", sidecar=replace(METRIC, control_points=unused))
    assert "The points of gcp_list.txt are not used: line 7 is wrong." in page


def test_the_focal_length_is_compared_with_exif(full):
    text = Reader(full).text
    assert "1170.0 px" in text  # nine tenths of 1300
    assert "+11.11 %" in text


def test_nothing_is_fetched_and_nothing_runs(full):
    for tag, attributes in Reader(full).tags:
        assert tag not in ("script", "iframe", "object", "link", "base", "form")
        assert not [name for name in attributes if name.startswith("on")]
        for name in ("src", "href"):
            assert (attributes.get(name) or "data:image/").startswith("data:image/")
    assert "url(" not in full
    assert "default-src &#x27;none&#x27;" in full


def test_skipped_files_show_themselves(full):
    (card,) = re.findall(
        r'<article class="card">((?:(?!</article>).)*copy\.jpg.*?)</article>', full
    )
    assert card.startswith('<img src="data:image/jpeg;base64,')


def test_photos_that_are_gone_are_said_to_be(full):
    assert "the file is no longer there" in full


def test_the_page_is_the_same_each_time(tmp_path):
    output = finished_output(tmp_path / "out")
    first = write_page(output).read_bytes()
    assert write_page(output).read_bytes() == first


def test_no_name_does_harm(tmp_path):
    names = dict(enumerate(HOSTILE))
    skipped = {f"skipped {name}": SkipReason.TOO_SMALL for name in HOSTILE}
    # The last of them in no model: each part that names photos has one.
    page = page_of(
        tmp_path / "<b>out",
        names={**names, 8: HOSTILE[0] + "8", 7: HOSTILE[1] + "7"},
        num_waiting=2,
        skipped=skipped,
        is_doubtful=True,
        why_not="<u>why</u>",
    )
    read = Reader(page)
    assert not read.open
    assert not {"script", "u", "b>out"} & {tag for tag, _ in read.tags}
    for tag, attributes in read.tags:
        assert not [name for name in attributes if name.startswith("on")], (tag, attributes)
        assert attributes.get("src") != "x"
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", page)
    assert HOSTILE[0] in read.text
    assert html.escape(HOSTILE[4]) in page


@pytest.mark.parametrize("state", [GeoreferenceState.NONE, GeoreferenceState.PROVISIONAL])
def test_a_model_that_is_not_metric_has_a_plan_of_its_own(tmp_path, state):
    sidecar = replace(METRIC, state=state, models_in_enu=(), residuals=None, reasons=("too few",))
    text = Reader(page_of(tmp_path / "out", sidecar=sidecar)).text
    assert "neither north nor metres are known" in text
    assert "too few" in text
    assert "Arrows point" not in text


def test_without_positions_nothing_is_said_of_them(tmp_path):
    read = Reader(page_of(tmp_path / "out", sidecar=None))
    assert "Accuracy" not in read.text
    assert "GPS" not in read.text
    assert "map" in read.sections


def test_without_a_model_there_is_still_a_page(tmp_path):
    read = Reader(page_of(tmp_path / "out", has_model=False, sidecar=None))
    assert "No model could be built from 9 photos" in read.text
    assert read.sections == {"unplaced", "matches", "time", "photos"}


def test_without_a_database_there_is_still_a_page(tmp_path):
    output = finished_output(tmp_path / "out")
    (output / "database.db").unlink()
    read = Reader(write_page(output).read_text(encoding="utf-8"))
    assert {"model", "map", "photos"} <= read.sections
    assert "inliers in the median pair" not in read.text


def test_photos_that_moved_are_found_in_the_folder_given(tmp_path):
    output = finished_output(tmp_path / "out", Output(skipped={"copy.png": SkipReason.DUPLICATE}))
    moved = (tmp_path / "photos").rename(tmp_path / "moved")
    assert write_page(output).read_text().count('<article class="card"><img') == 0
    assert write_page(output, moved).read_text().count('<article class="card"><img') == 1
    with pytest.raises(InputError, match="no such folder"):
        write_page(output, tmp_path / "nowhere")


def test_an_output_that_is_not_finished_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"report\.json"):
        write_page(tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_scene_beside_it_can_be_opened(tmp_path):
    output = finished_output(tmp_path / "flight")
    assert "scene.html" not in write_page(output).read_text(encoding="utf-8")
    (output / "scene.html").touch()
    page = Reader(write_page(output).read_text(encoding="utf-8"))
    assert ("a", {"href": "scene.html"}) in page.tags


def test_many_photos_that_are_missing_are_folded(tmp_path, monkeypatch):
    monkeypatch.setattr("sfm_front.reports.html.unplaced._OPEN", 2)
    read = Reader(page_of(tmp_path / "out", num_waiting=5))
    assert "3 more" in read.text
    assert sum(tag == "article" for tag, _ in read.tags) == 5
