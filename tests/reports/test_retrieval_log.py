"""retrieval.jsonl: what a line says, and what is read back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sfm_front.errors import StorageError
from sfm_front.events import PhotoAdded
from sfm_front.reports.retrieval_log import RetrievalLog, read_candidates
from sfm_front.types import CandidateOutcome, Rejected, Rejection

VERIFIED = CandidateOutcome("ä 1.jpg", 0.123456, 40, True, None)
REFUSED = CandidateOutcome("c.jpg", 0.95, 3, False, Rejected(Rejection.NO_EPIPOLAR_GEOMETRY, 31, 9))
UNSEEN = CandidateOutcome("d.jpg", 0.9, None, False, None)


def test_a_line_per_photo(tmp_path):
    with RetrievalLog(tmp_path) as log:
        log.add(PhotoAdded("ä 1.jpg", 1))
        log.add(PhotoAdded("b.jpg", 2, candidates=(VERIFIED, REFUSED, UNSEEN)))
    lines = (tmp_path / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line) for line in lines] == [
        {"name": "ä 1.jpg", "most_relevant": None, "candidates": []},
        {
            "name": "b.jpg",
            "most_relevant": "ä 1.jpg",
            "candidates": [
                {
                    "name": "ä 1.jpg",
                    "cosine": 0.12346,
                    "inliers": 40,
                    "verified": True,
                    "rejected": None,
                },
                {
                    "name": "c.jpg",
                    "cosine": 0.95,
                    "inliers": 3,
                    "verified": False,
                    "rejected": {"reason": "no epipolar geometry", "matches": 31, "inliers": 9},
                },
                {
                    "name": "d.jpg",
                    "cosine": 0.9,
                    "inliers": None,
                    "verified": False,
                    "rejected": None,
                },
            ],
        },
    ]
    assert "ä 1.jpg" in lines[0]  # readable, not escaped


def test_a_line_is_on_disk_before_the_next_photo(tmp_path):
    with RetrievalLog(tmp_path) as log:
        log.add(PhotoAdded("a.jpg", 1))
        assert len((tmp_path / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()) == 1


def test_candidates_are_read_back(tmp_path):
    with RetrievalLog(tmp_path) as log:
        log.add(PhotoAdded("a.jpg", 1))
        log.add(PhotoAdded("b.jpg", 2, candidates=(REFUSED, UNSEEN)))
    assert read_candidates(tmp_path, "b.jpg") == (REFUSED, UNSEEN)
    assert read_candidates(tmp_path, "a.jpg") == ()
    assert read_candidates(tmp_path, "none.jpg") == ()


def test_lines_of_earlier_versions_have_no_reasons(tmp_path):
    row = {"name": "a.jpg", "cosine": 0.5, "inliers": 20, "verified": False}
    line = {"name": "b.jpg", "most_relevant": "a.jpg", "candidates": [row]}
    (tmp_path / "retrieval.jsonl").write_text(json.dumps(line) + "\n", encoding="utf-8")
    assert read_candidates(tmp_path, "b.jpg") == (CandidateOutcome("a.jpg", 0.5, 20, False, None),)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's always full device")
def test_a_full_disk_is_told(tmp_path):
    log = RetrievalLog(tmp_path)
    log._file.close()
    log._file = Path("/dev/full").open("a", encoding="utf-8")  # noqa: SIM115
    with pytest.raises(StorageError, match=r"retrieval\.jsonl: .*No space left"):
        log.add(PhotoAdded("a.jpg", 1))
    log.close()
