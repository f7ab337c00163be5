"""Photos and verified pairs so far, as pycolmap's mapper reads them: the only streaming calls."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Set

import numpy as np
import pycolmap

from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
from sfm_front.types import Float32Array, PairGeometry, Uint32Array


class ViewGraph:
    """The photos and verified pairs that all models grow over.

    A photo's image, frame and (for its camera) rig ids equal the image and camera ids it is
    added with. The correspondence graph is never finalised: pycolmap cannot append to a
    finalised one, and answers queries on an open one.
    """

    def __init__(self) -> None:
        self._cache = pycolmap.DatabaseCache()
        self._neighbors: dict[int, dict[int, int]] = {}
        self._angles_rad: dict[tuple[int, int], float] = {}
        self._reduced: dict[tuple[int, int], Uint32Array] = {}
        # Counts changes: whatever was made of an earlier state is out of date.
        self.revision = 0

    def add(
        self,
        image_id: int,
        name: str,
        camera: pycolmap.Camera,
        keypoints: Float32Array,
        pairs: Iterable[PairGeometry],
    ) -> None:
        """Add a photo with keypoints (N, 4) and all its verified pairs with earlier photos."""
        cache = self._cache
        if not cache.exists_camera(camera.camera_id):
            cache.add_camera(camera)
            cache.add_rig(trivial_rig(camera))
        image = pycolmap.Image(
            name=name,
            keypoints=keypoints[:, :2].astype("float64"),
            camera_id=camera.camera_id,
            image_id=image_id,
        )
        image.frame_id = image_id
        cache.add_frame(trivial_frame(image))
        cache.add_image(image)
        self._neighbors[image_id] = {}
        self.add_pairs(pairs)

    def add_pairs(self, pairs: Iterable[PairGeometry]) -> None:
        """Add verified pairs of photos that are there, none of which has been added before.

        Models that hold these photos must be told: ``Model.take_pairs``.
        """
        self.revision += 1
        for pair in pairs:
            self._cache.correspondence_graph.add_two_view_geometry(
                pair.image_id1, pair.image_id2, pair.two_view_geometry
            )
            self._neighbors[pair.image_id1][pair.image_id2] = pair.num_inliers
            self._neighbors[pair.image_id2][pair.image_id1] = pair.num_inliers
            self._angles_rad[pair.image_id1, pair.image_id2] = pair.two_view_geometry.tri_angle

    def __len__(self) -> int:
        return len(self._neighbors)

    def num_neighbors(self, image_id: int, among: Set[int]) -> int:
        """How many of these photos have a verified pair with this one."""
        return len(self._neighbors[image_id].keys() & among)

    @property
    def image_ids(self) -> list[int]:
        """In order of arrival."""
        return list(self._neighbors)

    @property
    def cameras(self) -> dict[int, pycolmap.Camera]:
        """As photos were added with them, by camera id."""
        return dict(self._cache.cameras)

    def name(self, image_id: int) -> str:
        """What a photo is called."""
        return str(self._cache.image(image_id).name)

    def neighbors(self, image_id: int) -> dict[int, int]:
        """Photos with a verified pair with this one → inliers of the pair."""
        return self._neighbors[image_id]

    def strongest_neighbors(self, image_id: int) -> list[int]:
        """Photos with a verified pair with this one, most inliers first."""
        found = self._neighbors[image_id]
        return sorted(found, key=lambda other: -found[other])

    def matches(self, image_id1: int, image_id2: int) -> Uint32Array:
        """(M, 2) keypoint indices in either photo: the inliers of a verified pair."""
        graph = self._cache.correspondence_graph
        return np.asarray(graph.extract_matches_between_images(image_id1, image_id2), np.uint32)

    def pairs(self, among: Collection[int]) -> list[tuple[int, int]]:
        """Verified pairs of these photos, most inliers first; the later photo stands first."""
        members = set(among)
        found = [
            (-inliers, i, j)
            for i in members
            for j, inliers in self._neighbors[i].items()
            if j in members and (i, j) in self._angles_rad
        ]
        return [(i, j) for _, i, j in sorted(found)]

    def num_matches(self, pair: tuple[int, int]) -> int:
        """Of a verified pair."""
        return self._neighbors[pair[0]][pair[1]]

    def angle_deg(self, pair: tuple[int, int]) -> float | None:
        """Median triangulation angle of a verified pair, by its own two-view geometry.

        None if that geometry has no relative pose, as without a focal length.
        """
        angle_rad = self._angles_rad[pair]
        return math.degrees(angle_rad) if angle_rad >= 0 else None

    def keep_only(self, kept: Mapping[tuple[int, int], Uint32Array]) -> None:
        """Leave verified pairs, named as by ``pairs``, only these (M, 2) of their matches; a pair
        without any is taken out.

        Mappers made before go on as if nothing had been taken: whoever has one must make it anew.
        """
        for (first, second), matches in kept.items():
            self._neighbors[first][second] = self._neighbors[second][first] = len(matches)
            if len(matches) == 0:
                del self._neighbors[first][second], self._neighbors[second][first]
                del self._angles_rad[first, second]
        self._reduced.update(kept)
        self.revision += 1
        # pycolmap cannot take anything out.
        old, self._cache = self._cache, pycolmap.DatabaseCache()
        for camera in old.cameras.values():
            self._cache.add_camera(camera)
            self._cache.add_rig(old.rig(camera.camera_id))
        for image_id in self._neighbors:
            self._cache.add_frame(old.frame(image_id))
            self._cache.add_image(old.image(image_id))
        for pair in self._angles_rad:
            geometry = old.correspondence_graph.extract_two_view_geometry(*pair, True)
            if pair in kept:
                geometry.inlier_matches = kept[pair]
            self._cache.correspondence_graph.add_two_view_geometry(*pair, geometry)

    def pop_reduced(self) -> dict[tuple[int, int], Uint32Array]:
        """What ``keep_only`` has left of pairs since the last call."""
        reduced, self._reduced = self._reduced, {}
        return reduced

    def component(self, start: Iterable[int], *, among: Collection[int] | None = None) -> set[int]:
        """Photos linked to the given ones by chains of verified pairs, these included.

        ``among`` limits the chains to these photos.
        """
        found = set(start)
        frontier = list(found)
        while frontier:
            for neighbor in self._neighbors[frontier.pop()]:
                if neighbor not in found and (among is None or neighbor in among):
                    found.add(neighbor)
                    frontier.append(neighbor)
        return found

    def new_mapper(
        self, reconstruction: pycolmap.Reconstruction | None = None
    ) -> tuple[pycolmap.IncrementalMapper, pycolmap.Reconstruction]:
        """A mapper with a model over all photos so far: an empty one, or one read from disk.

        Call once there is a photo.
        """
        if reconstruction is None:
            reconstruction = pycolmap.Reconstruction()
        reconstruction.load(self._cache)
        mapper = pycolmap.IncrementalMapper(self._cache)
        mapper.begin_reconstruction(reconstruction)
        return mapper, reconstruction

    def observations_of(
        self, reconstruction: pycolmap.Reconstruction
    ) -> pycolmap.ObservationManager:
        """What photos see of a model that no mapper can go on with: its lenses may be others."""
        return pycolmap.ObservationManager(reconstruction, self._cache.correspondence_graph)

    def part(
        self,
        reconstruction: pycolmap.Reconstruction,
        image_ids: Collection[int],
        point_ids: Collection[int],
    ) -> pycolmap.Reconstruction:
        """A model of some registered photos, all points that they see, these other points, and the
        photos that see any of them: copies, under the ids that they have in the model."""
        points = {
            point.point3D_id
            for image_id in image_ids
            for point in reconstruction.image(image_id).get_observation_points2D()
        }.union(point_ids)
        seen = {point_id: reconstruction.point3D(point_id) for point_id in points}
        observers = {e.image_id for point in seen.values() for e in point.track.elements}
        part = pycolmap.Reconstruction()
        for image_id in sorted(observers.union(image_ids)):
            image = self._cache.image(image_id)
            if not part.exists_camera(image.camera_id):
                part.add_camera(reconstruction.camera(image.camera_id))
                part.add_rig(self._cache.rig(image.camera_id))
            part.add_frame(self._cache.frame(image.frame_id))
            part.add_image(image)
            pose = reconstruction.image(image_id).cam_from_world()
            part.frame(image.frame_id).rig_from_world = pose
            part.register_frame(image.frame_id)
        for point_id, point in seen.items():
            part.add_point3D_with_id(point_id, point)
        return part

    def extend(
        self,
        mapper: pycolmap.IncrementalMapper,
        reconstruction: pycolmap.Reconstruction,
        image_id: int,
    ) -> None:
        """Make a photo that was added after its mapper was made known to a model.

        ``Reconstruction.load`` would do the same, but walks all photos each time.
        """
        cache = self._cache
        image = cache.image(image_id)
        if not reconstruction.exists_camera(image.camera_id):
            reconstruction.add_camera(cache.camera(image.camera_id))
            reconstruction.add_rig(cache.rig(image.camera_id))
        reconstruction.add_frame(cache.frame(image.frame_id))
        reconstruction.add_image(image)
        mapper.observation_manager.add_image(image_id)
