"""Takes apart models that look-alike things have folded."""

from __future__ import annotations

from sfm_front.events import LookAlikesRefused
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.audit import agreeing
from sfm_front.mapping.lookalikes import find_fold
from sfm_front.mapping.model import Model

# Share of a pair's matches that agree with the folded model from which it is refused as a whole,
# and the matches that it must keep otherwise.
_MAX_AGREEING = 0.5
_MIN_MATCHES = 15


def unfold(atlas: Atlas) -> bool:
    """Take folded models apart, and grow the parts by the matches that remain; True if any was.

    Matches that put the two parts where they are not are taken out of the view graph. Those that
    contradict the folded model stay: where there are such, they join the parts the right way.
    """
    unfolded = False
    while any(_take_apart(atlas, model) for model in atlas.models):
        unfolded = True
        atlas.refine_until_stable()
    return unfolded


def _take_apart(atlas: Atlas, model: Model) -> bool:
    """Part a model if it is folded."""
    fold = find_fold(model.reconstruction, atlas.options.fold)
    if fold is None:
        return False
    kept, num_refused = {}, 0
    larger, graph = set(fold.parts[0]), atlas.view_graph
    crossing = [pair for pair in graph.pairs(model.registered) if len(larger & set(pair)) == 1]
    for pair, matches, agrees in agreeing(model.reconstruction, graph, crossing):
        if agrees.any():
            left = matches[~agrees]
            is_left = agrees.mean() < _MAX_AGREEING and len(left) >= _MIN_MATCHES
            kept[pair] = left if is_left else left[:0]
            num_refused += len(matches) - len(kept[pair])
    if not kept:
        return False
    atlas.emit(LookAlikesRefused(model.model_id, fold.parts, num_refused, fold.conflict))
    graph.keep_only(kept)
    atlas.replace(model, [model.only(part) for part in fold.parts])
    return True
