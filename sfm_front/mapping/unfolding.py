"""Takes apart models in which things that look alike stand in one place."""

from __future__ import annotations

from sfm_front.events import Evidence, LookAlikesRefused
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.audit import agreeing, misplaced
from sfm_front.mapping.lookalikes import find_fold
from sfm_front.mapping.model import Model

# Share of a pair's matches that agree with the folded model from which it is refused as a whole,
# and the matches that it must keep otherwise.
_MAX_AGREEING = 0.5
_MIN_MATCHES = 15


def unfold(atlas: Atlas) -> bool:
    """Take folded models apart, and grow the parts by the matches that remain; True if any was.

    Matches that put two parts where they are not are taken out of the view graph. Those that
    contradict the folded model stay: where there are such, they join the parts the right way.
    """
    unfolded = False
    while any(_take_apart(atlas, model) for model in atlas.models):
        unfolded = True
        atlas.refine_until_stable()
    return unfolded


def _take_apart(atlas: Atlas, model: Model) -> bool:
    """Part a model in two if it is folded."""
    graph, evidence = atlas.view_graph, Evidence.SURROUNDINGS
    parts = find_fold(model.reconstruction, graph, atlas.options.fold)
    if parts is None:
        parts, evidence = misplaced(model.reconstruction, graph), Evidence.MATCHES
    if parts is None:
        return False
    larger, kept, num_refused = set(parts[0]), {}, 0
    crossing = [pair for pair in graph.pairs(model.registered) if len(larger & set(pair)) == 1]
    for pair, matches, agrees in agreeing(model.reconstruction, graph, crossing):
        if agrees.any():
            left = matches[~agrees]
            is_left = agrees.mean() < _MAX_AGREEING and len(left) >= _MIN_MATCHES
            kept[pair] = left if is_left else left[:0]
            num_refused += len(matches) - len(kept[pair])
    if not kept:
        return False
    atlas.emit(LookAlikesRefused(model.model_id, parts, evidence, num_refused))
    graph.keep_only(kept)
    # A smaller part's photos wait, and start a model together with others.
    atlas.replace(model, [part for part in parts if len(part) >= atlas.options.min_model_size])
    return True
