"""What would help a photo that ended in no model."""

from __future__ import annotations

from collections.abc import Sequence, Set

from sfm_front.mapping.view_graph import ViewGraph

# Names in a sentence.
_MOST = 2


def hint(image_id: int, view_graph: ViewGraph, registered: Set[int], nearest: Sequence[int]) -> str:
    """Which photos to take, in words; empty if nothing is registered that it could be linked to.

    ``registered``: photos in some model; ``nearest``: photos by cosine to this one, best first.
    """
    overlapping = view_graph.neighbors(image_id)
    by_inliers = sorted(overlapping, key=lambda i: (-overlapping[i], i))
    linked = [i for i in by_inliers if i in registered]
    if linked:
        return f"take one between it and {_names(view_graph, linked)}, which share too little"
    near = [i for i in nearest if i in registered and i != image_id]
    if not near:
        return ""
    known = _names(view_graph, near)
    if by_inliers:
        others = _names(view_graph, by_inliers)
        return f"overlaps only with {others}: if {known} show the same place, take some between"
    return f"most similar are {known}: if they show the same place, take some between them and it"


def _names(view_graph: ViewGraph, image_ids: Sequence[int]) -> str:
    return ", ".join(view_graph.name(image_id) for image_id in image_ids[:_MOST])
