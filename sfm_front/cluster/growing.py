"""On a worker: groups of photos and their verified pairs → models, as a session makes them."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import pycolmap

from sfm_front.cluster.work import GroupPhoto, GroupWork, GrownModel, JoinWork
from sfm_front.cluster.workbench import Counts, Workbench
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.finishing import place_all
from sfm_front.mapping.model import Model
from sfm_front.mapping.model_state import ModelState
from sfm_front.mapping.view_graph import ViewGraph


def grow(bench: Workbench, work: GroupWork, counts: Counts) -> list[GrownModel]:
    """The models of a group, largest first: photo by photo, then all that a session does at its
    end short of the last adjustment, which the whole needs anyway."""
    graph = ViewGraph()
    atlas = Atlas(graph, bench.options.atlas)
    for photo in work.photos:
        _enter(photo, work, graph)
        atlas.add(photo.image_id)
    place_all(atlas)
    counts.items += len(work.photos)
    return [_packed(model) for model in atlas.models]


def join(bench: Workbench, work: JoinWork, counts: Counts) -> list[GrownModel]:
    """The models of two groups, joined where they fit and grown by what waits."""
    graph = ViewGraph()
    for photo in work.group.photos:
        _enter(photo, work.group, graph)
    atlas = Atlas(graph, bench.options.atlas)
    for reconstruction, state in unpacked(work.models):
        atlas.take_model(reconstruction, state)
    atlas.grow()
    counts.items += len(work.group.photos)
    return [_packed(model) for model in atlas.models]


def _enter(photo: GroupPhoto, work: GroupWork, graph: ViewGraph) -> None:
    camera, pairs = work.cameras[photo.camera_id], work.pairs.get(photo.image_id, ())
    graph.add(photo.image_id, photo.name, camera, photo.points, pairs)


def _packed(model: Model) -> GrownModel:
    with tempfile.TemporaryDirectory(prefix="sfm_front_") as folder:
        model.reconstruction.write_binary(folder)
        files = {file.name: file.read_bytes() for file in sorted(Path(folder).iterdir())}
    return GrownModel(files, model.state, model.num_registered)


def unpacked(models: Sequence[GrownModel]) -> list[tuple[pycolmap.Reconstruction, ModelState]]:
    """The models again, on the coordinator."""
    found = []
    for model in models:
        with tempfile.TemporaryDirectory(prefix="sfm_front_") as folder:
            for name, content in model.files.items():
                (Path(folder) / Path(name).name).write_bytes(content)
            found.append((pycolmap.Reconstruction(folder), model.state))
    return found
