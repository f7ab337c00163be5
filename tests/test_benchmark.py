"""The reconstruction benchmark: what it runs, measures, judges and prints."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from model_building import looking, make_model
from PIL import ExifTags, Image

from sfm_front.errors import ConfigError, DependencyError, InputError
from sfm_front.evaluation import benchmark, benchmark_chart
from sfm_front.evaluation.benchmark import OURS, SIFT_ALONE, Outcome, Row, benchmark_scene
from sfm_front.evaluation.benchmark_table import format_profile, format_table
from sfm_front.evaluation.benchmark_types import BenchmarkSettings, Run
from sfm_front.evaluation.ours import run_ours
from sfm_front.evaluation.process import measure
from sfm_front.evaluation.quality import Quality, assess
from sfm_front.evaluation.rivals import RIVALS, run_rival
from sfm_front.evaluation.scenes import BenchmarkScene, find_scene
from sfm_front.evaluation.sift_alone import sift_alone_seconds

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "benchmark_reconstruction.py"
SETTINGS = BenchmarkSettings(threads=1, max_image_size_px=160, max_features=200)
CAMERAS = {f"{i}.jpg": looking([i, 0, 0], [0, 1, 0], [0, 0, 1]) for i in range(4)}


def some(*names):
    return {name: CAMERAS[name] for name in names}


def write_model(folder, cameras):
    folder.mkdir(parents=True)
    make_model(cameras).write(folder)
    return folder


@pytest.fixture
def photos(tmp_path):
    """Four photos of noise: they have features, and nothing in common."""
    folder = tmp_path / "scene" / "images"
    folder.mkdir(parents=True)
    for i, name in enumerate(CAMERAS):
        coarse = np.random.default_rng(i).integers(0, 255, (15, 20, 3), dtype=np.uint8)
        Image.fromarray(coarse).resize((160, 120), Image.Resampling.BICUBIC).save(folder / name)
    return folder


# Processes


def test_a_process_is_measured_by_its_own_peak(tmp_path):
    block = 150 * 2**20
    code = f"import time; x = bytearray({block}); del x; time.sleep(0.3); print('a'); print('done')"
    measured = measure([sys.executable, "-c", code], tmp_path / "log.txt")
    assert measured.return_code == 0
    assert measured.last_line == "done"
    assert measured.wall_seconds >= 0.3
    if not Path("/proc/self/status").exists():
        pytest.skip("peak memory is read from /proc")
    assert block < measured.peak_memory_bytes < 2 * block


def test_the_peak_of_this_process_is_not_the_peak_of_its_child(tmp_path):
    large = bytearray(400 * 2**20)
    measured = measure([sys.executable, "-c", "import time; time.sleep(0.3)"], tmp_path / "log.txt")
    assert len(large) > (measured.peak_memory_bytes or 0)


def test_a_failing_process_tells_its_status_and_last_line(tmp_path):
    code = "import sys; print('first'); sys.exit('it broke')"
    measured = measure([sys.executable, "-c", code], tmp_path / "log.txt")
    assert (measured.return_code, measured.last_line) == (1, "it broke")


# Scenes


def test_a_scene_is_a_folder_of_photos_or_has_one(photos):
    for folder in (photos, photos.parent):
        scene = find_scene(folder)
        assert (scene.name, scene.num_photos) == ("scene", 4)
        assert scene.photos.resolve() == photos
        assert scene.truth is None
        assert scene.pairs is None


@pytest.mark.parametrize("place", ["scene/gt", "scene/images/gt"])
def test_truth_is_found_beside_and_among_the_photos(tmp_path, photos, place):
    truth = write_model(tmp_path / place, CAMERAS)
    assert find_scene(photos).truth == truth
    assert find_scene(photos.parent).truth == truth


def test_pairs_are_read_without_a_model(photos):
    (photos.parent / "gt").mkdir()
    listed = photos.parent / "gt" / "covisible_pairs.txt"
    listed.write_text("1.jpg 0.jpg\n\n2.jpg 3.jpg 0.7\n")
    scene = find_scene(photos)
    assert scene.truth is None
    assert scene.pairs == (("1.jpg", "0.jpg"), ("2.jpg", "3.jpg"))
    listed.write_text("1.jpg 0.jpg\n2.jpg\n")
    with pytest.raises(InputError, match="line 2: expected two names"):
        find_scene(photos)


def test_truth_that_is_no_model_is_refused(tmp_path, photos):
    write_model(tmp_path / "truth" / "0", CAMERAS)
    with pytest.raises(InputError, match=r"no COLMAP model in it; try .*truth.0"):
        find_scene(photos, tmp_path / "truth")
    assert find_scene(photos, tmp_path / "truth" / "0").truth == tmp_path / "truth" / "0"


# Quality


def test_models_are_judged_together(tmp_path, photos):
    scene = BenchmarkScene(
        name="scene",
        photos=photos,
        num_photos=4,
        truth=write_model(tmp_path / "truth", CAMERAS),
        pairs=(("0.jpg", "1.jpg"), ("1.jpg", "2.jpg"), ("0.JPG", "2.jpg"), ("2.jpg", "3.jpg")),
    )
    folders = [
        write_model(tmp_path / "0", some("0.jpg", "1.jpg", "2.jpg")),
        write_model(tmp_path / "1", some("2.jpg", "3.jpg")),
    ]
    quality = assess(folders, scene)
    assert (quality.registered, quality.registered_in_all, quality.models) == (3, 4, 2)
    assert quality.pairs_joined == 1
    assert quality.auc == pytest.approx([1, 1, 1], abs=1e-5)
    assert (quality.points, quality.reprojection_error_px) == (0, None)
    first = assess(folders[:1], scene)
    assert first.pairs_joined == 0.75
    # Three of four errors are nought, one is infinite.
    assert first.auc == pytest.approx([0.75, 0.75, 0.75], abs=1e-5)


def test_no_model_is_worth_nothing(tmp_path, photos):
    truth = write_model(tmp_path / "truth", CAMERAS)
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4, truth=truth)
    quality = assess([], scene)
    assert (quality.registered, quality.registered_in_all, quality.auc) == (0, 0, (0, 0, 0))
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4)
    assert assess([], scene).auc is None


# Methods


def test_a_rival_that_finds_no_model_says_so(tmp_path, photos):
    run = run_rival("exhaustive", photos, tmp_path / "work", SETTINGS)
    assert run.models == ()
    assert "no initial pair" in run.failure
    assert set(run.seconds_by_stage) == {"extract", "match", "map"}
    assert 0 < sum(run.seconds_by_stage.values()) < run.wall_seconds
    assert (tmp_path / "work" / "database.db").is_file()


@pytest.mark.parametrize("orientation", [None, 1])
def test_spatial_pairing_without_positions_says_so(tmp_path, photos, orientation):
    if orientation is not None:  # of which pycolmap makes a prior for the direction of gravity
        exif = Image.Exif()
        exif[ExifTags.Base.Orientation] = orientation
        for photo in photos.iterdir():
            Image.open(photo).save(photo, exif=exif)
    run = run_rival("spatial", photos, tmp_path / "work", SETTINGS)
    assert run.failure == "these photos have no GPS position"


def test_an_unknown_rival_is_refused(tmp_path, photos):
    with pytest.raises(ConfigError, match=", ".join(RIVALS)):
        run_rival("transitive", photos, tmp_path / "work", SETTINGS)
    assert not (tmp_path / "work").exists()


FAKE = """
import json, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from model_building import looking, make_model
output = Path(sys.argv[sys.argv.index("--output") + 1])
for number, count in enumerate((3, 1)):
    folder = output / "sparse" / str(number)
    folder.mkdir(parents=True)
    cameras = {{f"{{i}}.jpg": looking([i, 0, 0], [0, 1, 0], [0, 0, 1]) for i in range(count)}}
    make_model(cameras).write(folder)
photos = [
    {{"name": "0.jpg", "skipped": None, "seconds": {{"sift": 0.5, "map": 0.25}}}},
    {{"name": "x.jpg", "skipped": {{"reason": "empty file"}}, "registered": False}},
    {{"name": "1.jpg", "skipped": None, "seconds": {{"sift": 1.0}}}},
]
totals = {{"seconds_by_stage": {{"sift": 1.5, "map": 0.25, "finish": 0.125}}}}
(output / "report.json").write_text(json.dumps({{"photos": photos, "totals": totals}}))
(output / "arguments.json").write_text(json.dumps(sys.argv[1:]))
"""


@pytest.fixture
def fake(tmp_path):
    """A command that reconstructs nothing and reports as ours does."""
    script = tmp_path / "fake.py"
    script.write_text(FAKE.format(tests=str(Path(__file__).parent)))
    return [sys.executable, str(script)]


def test_ours_is_started_with_the_settings_and_its_report_is_read(tmp_path, photos, fake):
    settings = BenchmarkSettings(threads=3, max_features=123, order="random", seed=5)
    run = run_ours(fake, photos, tmp_path / "work", settings)
    assert run.failure is None
    assert run.photo_seconds == (0.75, 1.0)
    assert run.seconds_by_stage == {"sift": 1.5, "map": 0.25, "finish": 0.125}
    assert [folder.name for folder in run.models] == ["0", "1"]
    given = json.loads((tmp_path / "work" / "output" / "arguments.json").read_text())
    assert given[0] == str(photos)
    options = dict(zip(given[1::2], given[2::2], strict=True))
    del options["--output"]
    assert options == {
        "--max-image-size": "1600",
        "--max-features": "123",
        "--threads": "3",
        "--camera-mode": "auto",
        "--order": "random",
        "--seed": "5",
    }


def test_ours_that_fails_says_why(tmp_path, photos):
    command = [sys.executable, "-c", "import sys; sys.exit('no pair of photos overlaps')"]
    run = run_ours(command, photos, tmp_path / "work", SETTINGS)
    assert run.failure == "exit status 1: no pair of photos overlaps"
    assert run.models == ()


def test_sift_alone_counts_every_photo_that_can_be_read(tmp_path, photos):
    (photos / "broken.jpg").write_bytes(b"no image")
    assert 0 < sift_alone_seconds(photos, tmp_path / "work", SETTINGS) < 60


def test_methods_take_turns_and_leave_nothing(tmp_path, photos, fake, monkeypatch):
    seeds = []

    def rival(name, _, folder, settings):
        seeds.append(settings.seed)
        folder.mkdir(parents=True)
        return Run(wall_seconds=7.0, peak_memory_bytes=None, failure=f"{name} broke")

    def alone(_, folder, __):
        folder.mkdir(parents=True)
        return 0.5

    monkeypatch.setattr(benchmark, "run_rival", rival)
    monkeypatch.setattr(benchmark, "sift_alone_seconds", alone)
    notes = []
    scene = find_scene(photos)
    arguments = {"ours": fake, "runs": 2, "workspace": tmp_path / "w", "note": notes.append}
    rows = benchmark_scene(scene, ["spatial"], SETTINGS, keep=False, **arguments)
    assert [row.method for row in rows] == [SIFT_ALONE, OURS, "spatial"]
    assert [note.split(", ")[2].split(":")[0] for note in notes] == 2 * [
        SIFT_ALONE,
        OURS,
        "spatial",
    ]
    assert seeds == [0, 1]
    assert not list((tmp_path / "w").rglob("*.json"))
    assert rows[1].means()["registered"] == 3
    assert rows[2].failures == ("spatial broke",)
    json.dumps([row.as_dict() for row in rows])
    kept = benchmark_scene(scene, [], SETTINGS, keep=True, **arguments)
    assert all(
        Path(folder).is_dir() for run in kept[1].as_dict()["runs"] for folder in run["models"]
    )
    assert all(run["models"] for run in kept[1].as_dict()["runs"])


# Table and chart


def row(scene, method, seconds, registered, **run):
    quality = Quality(
        registered=registered,
        registered_in_all=registered,
        models=int(registered > 0),
        points=100 * registered,
        reprojection_error_px=0.5 if registered else None,
        auc=None,
        pairs_joined=None,
    )
    made = Run(wall_seconds=seconds, peak_memory_bytes=3 * 2**20, **run)
    return Row(scene, method, (Outcome(made, quality),))


@pytest.fixture
def rows(photos):
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4)
    alone = Run(wall_seconds=5.0, peak_memory_bytes=None)
    return [
        Row(scene, SIFT_ALONE, (Outcome(alone, None),)),
        row(scene, OURS, 10.0, 4, photo_seconds=(1.0, 2.0, 9.0), seconds_by_stage={"map": 2.5}),
        row(scene, "exhaustive", 25.0, 3),
        row(scene, "spatial", 3.0, 0, failure="these photos have no GPS position"),
    ]


def table(rows):
    lines = format_table(rows).splitlines()
    edges = [len(part) for part in lines[1].split("  ")]
    starts = np.cumsum([0] + [edge + 2 for edge in edges])
    cut = [[line[a : a + n].strip() for a, n in zip(starts, edges, strict=False)] for line in lines]
    return {line[1]: dict(zip(cut[0], line, strict=True)) for line in cut[2:] if line[1:2]}


def test_the_table_compares_with_ours(rows):
    cells = table(rows)
    assert cells[OURS]["seconds"] == "10.0"
    assert cells["exhaustive"]["speed-up"] == "2.50"
    assert cells[SIFT_ALONE]["speed-up"] == "0.50"
    assert cells["spatial"]["speed-up"] == "-"  # it has no model to be fast with
    assert cells[OURS]["photo median s"] == "2.00"
    assert cells[OURS]["p95 s"] == f"{np.percentile([1, 2, 9], 95):.2f}"
    assert cells["exhaustive"]["registered"] == "3/4"
    assert cells["exhaustive"]["memory MiB"] == "3"
    assert "AUC@1" not in cells[OURS]  # nothing to say in this column
    assert "scene, spatial: these photos have no GPS position" in format_table(rows)


def test_rows_are_means_over_runs(rows):
    both = Row(rows[1].scene, OURS, rows[1].outcomes + rows[2].outcomes)
    means = both.means()
    assert (means["seconds"], means["registered"], means["points"]) == (17.5, 3.5, 350)
    assert means["photo_seconds_median"] == 2.0
    assert both.stage_means() == {"map": 2.5}  # over the runs that know the stage
    assert table([both])[OURS]["registered"] == "3.5/4"


def test_the_profile_shows_shares_of_the_whole(rows):
    assert format_profile(rows[1]).splitlines()[1].split() == ["map", "2.50", "s", "25.0", "%"]


def test_the_chart_is_written(tmp_path, rows):
    pytest.importorskip("matplotlib")
    benchmark_chart.write_chart(rows, tmp_path / "new" / "chart.png")
    assert Image.open(tmp_path / "new" / "chart.png").size[0] > 500
    with pytest.raises(InputError, match="cannot write the chart"):
        benchmark_chart.write_chart(rows, tmp_path / "chart.nonsense")


def test_a_chart_without_matplotlib_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DependencyError, match="pip install matplotlib"):
        benchmark_chart.check_matplotlib()


# Settings and script


@pytest.mark.parametrize("wrong", [{"threads": 0}, {"max_features": 0}, {"camera_mode": "one"}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match="got"):
        BenchmarkSettings(**{"threads": 1, **wrong})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rivals", "exhaustive,psychic"], "psychic unknown"),
        (["--runs", "0"], "--runs must be at least 1"),
        (["--keep", "."], "not empty"),
        (["--gt", "nowhere"], "no COLMAP model"),
    ],
)
def test_the_script_refuses_before_it_runs(photos, arguments, message):
    done = subprocess.run(
        [sys.executable, SCRIPT, photos, *arguments],
        cwd=photos.parent,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
