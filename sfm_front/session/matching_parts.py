"""What finds the verified pairs of a photo and its candidates, here or on a worker of a cluster."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.matching.guided_matching import GuidedMatcher
from sfm_front.matching.matcher import Matcher, make_matcher
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.rerank import Reranker
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.options import SessionOptions
from sfm_front.session.pair_matching import CandidateMatcher


@dataclass(frozen=True)
class MatchingParts:
    """``reranker`` orders the candidates of a photo, ``pairs`` matches the best of them."""

    matcher: Matcher
    verifier: Verifier
    reranker: Reranker
    pairs: CandidateMatcher


def make_matching(options: SessionOptions, device: str, workers: WorkerPool) -> MatchingParts:
    """``device``: from ``devices.usable_device``."""
    verifier = Verifier(options.verification)
    matcher = make_matcher(device, options.matching, workers)
    rotation = options.matching.rotation
    reranker, second_reranker = (
        Reranker(rerank, matcher, verifier, workers, rotation=rotation)
        for rerank in (options.rerank, options.second_rerank)
    )
    guided = GuidedMatcher(options.guided, options.matching, options.verification, workers)
    pairs = CandidateMatcher(
        options.pair_matching, matcher, second_reranker, verifier, guided, workers
    )
    return MatchingParts(matcher, verifier, reranker, pairs)
