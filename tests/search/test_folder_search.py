"""Searching a folder: order, the query itself, methods, verified matches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import photo_files

from sfm_front.errors import ConfigError
from sfm_front.features.cached_extraction import CachedExtraction
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.source import list_photos
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.search.folder_search import Answer, FolderSearch, SearchOptions
from sfm_front.search.photo_index import PhotoIndex
from sfm_front.types import ExtractedPhoto, PhotoPath

MATCH_ERROR_PX = 3.0
RIGHT_MATCHES = 0.95


class World:
    """A folder of three scenes, three photos each, indexed."""

    def __init__(self, folder: Path) -> None:
        self.photos = folder / "photos"
        names = [f"{scene}_{shift}.png" for scene in (1, 2, 3) for shift in (0, 60, 120)]
        photo_files.save(self.photos, *names)
        self.outside = photo_files.save(folder / "outside", "2_30.png")[0]
        self.describer = CachedExtraction(
            folder / "index",
            PhotoReader(),
            SiftExtractor(SiftOptions(max_features=400)),
            {"vlad": GlobalDescriptor(local=[Vlad()])},
        )
        self.index = PhotoIndex(folder / "index", self.describer)
        self.index.update(list_photos(self.photos), num_threads=1)

    def described(self, path: Path) -> ExtractedPhoto:
        return self.describer.describe(PhotoPath(path.name, path)).photo

    def ask(self, path: Path, **options) -> Answer:
        with WorkerPool(1) as workers:
            search = FolderSearch(self.index, SearchOptions(**options), workers)
            return search.ask(self.described(path))


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> World:
    return World(tmp_path_factory.mktemp("world"))


def names(answer: Answer) -> list[str]:
    return [found.photo.name for found in answer.found]


@pytest.mark.parametrize("method", ["ours", "exhaustive", "cosine"])
def test_photos_of_the_querys_scene_come_first(world, method):
    answer = world.ask(world.outside, method=method)
    assert set(names(answer)[:3]) == {"2_0.png", "2_60.png", "2_120.png"}
    assert names(answer)[2] == "2_120.png"  # It shares least with the query.
    assert len(answer.found) == 9


def test_a_query_of_the_folder_does_not_find_itself(world):
    answer = world.ask(world.photos / "1_60.png")
    assert len(answer.found) == 8
    assert "1_60.png" not in names(answer)
    assert set(names(answer)[:2]) == {"1_0.png", "1_120.png"}


def test_it_does_not_take_a_candidates_place(world):
    answer = world.ask(world.photos / "1_60.png", retrieval=RetrievalOptions(candidates=2))
    assert [found.inliers is not None for found in answer.found] == [True] * 2 + [False] * 6


def test_verified_candidates_come_first_by_inliers(world):
    answer = world.ask(world.outside, retrieval=RetrievalOptions(candidates=4))
    inliers = [found.inliers for found in answer.found]
    assert inliers[:3] == sorted(inliers[:3], reverse=True)
    assert inliers[2] >= 15
    assert sum(count is not None for count in inliers) == 4
    assert set(answer.seconds) == {"coarse", "read", "fine", "rank"}


def test_by_cosine_alone_nothing_is_matched(world):
    answer = world.ask(world.outside, method="cosine")
    cosines = [found.cosine for found in answer.found]
    assert cosines == sorted(cosines, reverse=True)
    assert {found.inliers for found in answer.found} == {None}


def test_exhaustive_matches_everything_on_all_features(world):
    exhaustive = world.ask(
        world.outside, method="exhaustive", retrieval=RetrievalOptions(candidates=1)
    )
    assert None not in [found.inliers for found in exhaustive.found]


def test_no_such_method():
    with pytest.raises(ConfigError, match="method must be one of ours, exhaustive, cosine"):
        SearchOptions(method="fast")


def test_verified_matches_show_the_same_place(world):
    with WorkerPool(1) as workers:
        search = FolderSearch(world.index, SearchOptions(), workers)
        photos = [world.described(world.photos / name) for name in ("3_0.png", "3_60.png")]
        matches = search.verified_matches(*photos)
    assert 30 < len(matches.xy1) <= matches.tentative
    # The second photo was taken 60 pixels to the right. A wrong match may lie on its epipolar line.
    away = np.linalg.norm(matches.xy1 - matches.xy2 - (60, 0), axis=1)
    assert (away < MATCH_ERROR_PX).mean() > RIGHT_MATCHES


def test_photos_of_different_scenes_have_no_verified_matches(world):
    with WorkerPool(1) as workers:
        search = FolderSearch(world.index, SearchOptions(), workers)
        photos = [world.described(world.photos / name) for name in ("3_0.png", "1_60.png")]
        matches = search.verified_matches(*photos)
    assert matches.xy1.shape == matches.xy2.shape == (0, 2)
