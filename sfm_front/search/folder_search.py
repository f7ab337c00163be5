"""Search a folder of photos by photo: cosine candidates, re-ranked by verified SIFT matches."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from sfm_front.errors import ConfigError
from sfm_front.matching.matcher import make_matcher
from sfm_front.matching.nearest_neighbors import NO_MATCHES, MatchingOptions, match_descriptors
from sfm_front.matching.verification import VerificationOptions, Verifier
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions, Retriever
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.search.photo_index import PhotoIndex, view_of
from sfm_front.types import Candidate, ExtractedPhoto, Float64Array, PairGeometry, PhotoPath

SearchMethod = Literal["ours", "exhaustive", "cosine"]

_NOT_INDEXED = 0


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """How photos are ranked.

    ``method``:
      ``ours``: those of highest cosine by verified matches of their largest features, then the
      others by what they and the query look like.
      ``exhaustive``: all by verified matches of all features, likewise.
      ``cosine``: all by cosine.
    """

    method: SearchMethod = "ours"
    retrieval: RetrievalOptions = field(default_factory=RetrievalOptions)
    rerank: RerankOptions = field(default_factory=RerankOptions)
    matching: MatchingOptions = field(default_factory=MatchingOptions)
    verification: VerificationOptions = field(default_factory=VerificationOptions)

    def __post_init__(self) -> None:
        if self.method not in get_args(SearchMethod):
            raise ConfigError(
                f"method must be one of {', '.join(get_args(SearchMethod))}, got {self.method}"
            )


@dataclass(frozen=True, slots=True)
class Found:
    """A photo in an answer; ``inliers`` is None where its matches were not looked at."""

    photo: PhotoPath
    image_id: int
    cosine: float
    inliers: int | None


@dataclass(frozen=True, slots=True)
class Answer:
    """Photos of the folder, best first.

    ``seconds`` of the ``coarse`` step, to ``read`` the features of the photos it proposed, of the
    ``fine`` step, and to ``rank`` all others.
    """

    query: PhotoPath
    found: tuple[Found, ...]
    seconds: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class VerifiedMatches:
    """Two photos of the same scene: ``xy1`` and ``xy2`` (M, 2) of their verified matches, in
    pixels of the files, and how many ``tentative`` ones there were."""

    xy1: Float64Array
    xy2: Float64Array
    tentative: int


class FolderSearch:
    """Answers queries from an index that is up to date."""

    def __init__(
        self, index: PhotoIndex, options: SearchOptions, workers: WorkerPool, *, device: str = "cpu"
    ) -> None:
        """``device``: one that ``devices.usable_device`` has given, for matching."""
        self._index = index
        self._options = options
        self._workers = workers
        self._matching = options.matching
        self._verifier = Verifier(options.verification)
        matcher = make_matcher(device, self._matching, workers)
        self._reranker = Reranker(self._rerank_options(), matcher, self._verifier, workers)
        vectors = workers.map(index.vector, index.photos)
        dimension = len(vectors[0]) if vectors else 0
        self._num_candidates = self._how_many_to_match(len(vectors))
        self._retriever = Retriever(self._retrieval_options(), dimension)
        for image_id, vector in zip(index.photos, vectors, strict=True):
            self._retriever.remember(image_id, vector)
        self._ids = {photo.path.resolve(): image_id for image_id, photo in index.photos.items()}

    def ask(self, query: ExtractedPhoto) -> Answer:
        """Rank the folder's photos. The query, where it is one of them, is not in the answer."""
        clock = Stopwatch()
        query_id = self._ids.get(query.path.resolve(), _NOT_INDEXED)
        with clock.stage("coarse"):
            proposed = self._proposed(query, query_id)
        with clock.stage("read"):
            ids = [candidate.image_id for candidate in proposed]
            views = dict(zip(ids, self._workers.map(self._index.__getitem__, ids), strict=True))
        with clock.stage("fine"):
            reranked = self._reranker.rerank(view_of(query_id, query), proposed, views)
        with clock.stage("rank"):
            ranked = self._retriever.rank(
                query.global_vector, reranked, min_inliers=self._verifier.options.min_inliers
            )
        found = tuple(
            Found(self._index.photos[c.image_id], c.image_id, c.cosine, c.inliers)
            for c in ranked
            if c.image_id != query_id
        )
        return Answer(PhotoPath(query.name, query.path), found, clock.seconds)

    def _proposed(self, query: ExtractedPhoto, query_id: int) -> list[Candidate]:
        """The photos to be re-ranked: never the query's own."""
        if self._options.method == "cosine":
            return []
        found = self._retriever.candidates(query.global_vector)
        return [c for c in found if c.image_id != query_id][: self._num_candidates]

    def verified_matches(self, query: ExtractedPhoto, other: ExtractedPhoto) -> VerifiedMatches:
        """Match two photos on all features, and verify; no match is left if they are rejected."""
        view1, view2 = view_of(1, query), view_of(2, other)
        matches = match_descriptors(
            view1.features.descriptors, view2.features.descriptors, self._matching
        )
        pair = self._verifier.verify(view1, view2, matches)
        inliers = NO_MATCHES
        if isinstance(pair, PairGeometry):
            inliers = pair.two_view_geometry.inlier_matches
        return VerifiedMatches(
            view1.points(inliers[:, 0]), view2.points(inliers[:, 1]), len(matches)
        )

    def _how_many_to_match(self, num_photos: int) -> int:
        return {
            "ours": self._options.retrieval.candidates,
            "exhaustive": num_photos,
            "cosine": 0,
        }[self._options.method]

    def _retrieval_options(self) -> RetrievalOptions:
        # One more: the query may be among them.
        options = replace(self._options.retrieval, candidates=self._num_candidates + 1)
        return replace(options, num_expansion=0) if self._options.method == "cosine" else options

    def _rerank_options(self) -> RerankOptions:
        if self._options.method == "exhaustive":
            return replace(self._options.rerank, max_features=sys.maxsize)
        return self._options.rerank
