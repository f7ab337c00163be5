"""Methods to search photos by photo, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.methods.bag_of_words import BagOfWords
from sfm_front.evaluation.retrieval.methods.by_vector import ByVector
from sfm_front.evaluation.retrieval.methods.exhaustive import Exhaustive
from sfm_front.evaluation.retrieval.methods.hierarchical import Hierarchical
from sfm_front.evaluation.retrieval.methods.joined import Joined
from sfm_front.evaluation.retrieval.methods.perceptual import ByPerceptualHash
from sfm_front.evaluation.retrieval.methods.vocabulary_tree import VocabularyTree
from sfm_front.evaluation.retrieval.types import Method
from sfm_front.features.global_descriptors.descriptor import NAMES
from sfm_front.runtime.worker_pool import WorkerPool

NUM_TREES = 3
"""Number of vocabulary trees that vote together, each learnt on different descriptors."""

Maker = Callable[[WorkerPool], Method]


def _by_vector(name: str) -> Maker:
    return lambda _: ByVector(name)


def _several_trees(workers: WorkerPool) -> Method:
    trees = [VocabularyTree(seed=s, num_threads=workers.num_threads) for s in range(NUM_TREES)]
    return Joined("multi_vocabulary_tree", trees)


METHODS: Mapping[str, Maker] = MappingProxyType(
    {
        **{name: _by_vector(name) for name in NAMES},
        "bow": lambda workers: BagOfWords(num_threads=workers.num_threads),
        "vocabulary_tree": lambda workers: VocabularyTree(num_threads=workers.num_threads),
        "multi_vocabulary_tree": _several_trees,
        "exhaustive": lambda workers: Exhaustive(workers),
        "phash": lambda _: ByPerceptualHash(),
        "ours": lambda workers: Hierarchical(workers),
    }
)
"""The maker of each method with its defaults."""


def make_method(name: str, workers: WorkerPool) -> Method:
    """The method called ``name``, which may use ``workers``.

    Raises ConfigError if there is none.
    """
    if name not in METHODS:
        raise ConfigError(f"no retrieval method is called {name!r}: choose {', '.join(METHODS)}")
    return METHODS[name](workers)
