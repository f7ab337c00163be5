"""The options of a session reach the parts they are meant for, by TOML too."""

from __future__ import annotations

import pytest
from helpers import photo_files
from helpers.photo_stream import described

from sfm_front.cli.config_file import as_toml, read_options
from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.features.sift import SiftOptions
from sfm_front.matching.in_plane_rotation import RotationOptions
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.session import session as session_module
from sfm_front.session.options import SessionOptions
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.session.session import Session
from sfm_front.types import RankedCandidate, SkipReason

TUNED = {
    "cameras": {"photos_per_size": 9, "min_focal_factor": 0.2, "max_focal_factor": 8.0},
    "sift": {
        "described_per_kept": 3,
        "large_photo_px": 700_000,
        "contrast_threshold": 0.05,
        "small_photo_contrast_threshold": 0.01,
    },
    "retrieval.index": {"shortlist": 256, "shortlist_growth": 9.0, "expansion_depth": 120},
    "rerank": {"batch_size": 6, "good_inliers": 40},
    "second_rerank": {"batch_size": 7, "good_inliers": 50},
    "matching.rotation": {
        "tolerance_deg": 25.0,
        "min_matches": 20,
        "min_agreeing": 0.5,
        "num_sectors": 12,
    },
    "guided": {"min_baseline_sine": 0.1, "rotation_tolerance_deg": 40.0},
    "verification": {"gate_confidence": 0.99, "max_gate_trials": 1000, "min_model_trials": 100},
}


def part_of(options: SessionOptions, table: str) -> object:
    part: object = options
    for name in table.split("."):
        part = getattr(part, name)
    return part


def options(**changes: object) -> SessionOptions:
    return SessionOptions(**({"global_descriptor": "vlad", "threads": 1} | changes))


def test_what_was_tuned_is_printed_and_read(tmp_path):
    file = tmp_path / "tuned.toml"
    lines = ["vlad_weight = 0.75"]
    for table, values in TUNED.items():
        lines += [f"[{table}]", *(f"{name} = {value}" for name, value in values.items())]
    file.write_text("\n".join(lines))
    read, default = read_options(file), SessionOptions()
    assert (read.vlad_weight, default.vlad_weight) == (0.75, 0.8)
    printed = as_toml(read)
    assert "vlad_weight = 0.75" in printed
    for table, values in TUNED.items():
        block = printed.split(f"\n[{table}]\n")[1].split("\n\n")[0].splitlines()
        for name, value in values.items():
            assert getattr(part_of(read, table), name) == value
            assert getattr(part_of(default, table), name) != value
            assert f"{name} = {value}" in block


def test_the_number_of_features_is_set_at_the_top():
    assert SessionOptions(max_features=70).sift.max_features == 70
    given = SiftOptions(max_features=9, described_per_kept=2)
    assert SessionOptions(sift=given).sift == SiftOptions(described_per_kept=2)


def test_a_session_hands_its_sift_options_on(tmp_path):
    path = photo_files.save(tmp_path, "1_0.png")[0]
    no_faint_ones = SiftOptions(small_photo_contrast_threshold=0.99)
    with Session(tmp_path / "all", options()) as session:
        assert session.add(path).num_keypoints > 0
    with Session(tmp_path / "none", options(sift=no_faint_ones)) as session:
        assert session.add(path).reason is SkipReason.NO_FEATURES


@pytest.mark.parametrize("min_matches", [16, 10_000])
def test_a_session_hands_its_rotation_options_on(tmp_path, monkeypatch, min_matches):
    ranked: list[RankedCandidate] = []
    match = CandidateMatcher.match

    def matching_of(self, query, candidates, *args, **kwargs):
        ranked.extend(candidates)
        return match(self, query, candidates, *args, **kwargs)

    monkeypatch.setattr(CandidateMatcher, "match", matching_of)
    scene = make_scene(12, 300, seed=5, layout="orbit")
    matching = MatchingOptions(rotation=RotationOptions(min_matches=min_matches))
    with Session(tmp_path / "output", options(matching=matching)) as session:
        for index in (0, 1):
            session.add_extracted(described(scene, index))
    (candidate,) = ranked
    assert candidate.inliers > 16
    assert (candidate.rotation_rad is None) == (min_matches > candidate.inliers)


def test_a_session_hands_the_weight_of_vlad_on(tmp_path, monkeypatch):
    weights = []

    def recording(name: str, *, vlad_weight: float, **others: object) -> object:
        weights.append(vlad_weight)
        return resolve(name, vlad_weight=vlad_weight, **others)

    monkeypatch.setattr(session_module, "resolve", recording)
    Session(tmp_path / "output", options(vlad_weight=0.6)).close()
    assert weights == [0.6]


@pytest.mark.parametrize("vlad_weight", [0.0, 1.0])
def test_a_weight_that_leaves_a_part_out_is_refused(vlad_weight):
    with pytest.raises(ConfigError, match="vlad_weight must be above 0 and below 1"):
        options(vlad_weight=vlad_weight)
