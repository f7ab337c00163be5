"""COLMAP's own pose-prior pipeline on the priors that a session writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import centre_of, described, true_matches, true_pair

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import GeoPosition

NUM_PHOTOS = 12
MIN_SHARED_POINTS = 30
HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M = 0.05, 0.1
# Four standard deviations of a height. In another frame or scale they are many metres off.
POSITION_TOLERANCE_M = 0.4
HOME = LocalFrame(47.0, 8.0, 500.0)


@pytest.fixture(scope="module")
def strip() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 300, seed=3, layout="strip")


def positions_of(scene: SyntheticScene) -> dict[int, GeoPosition]:
    """By image id, with noise."""
    rng = np.random.default_rng(4)
    sigmas = HORIZONTAL_SIGMA_M, HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M
    centres = np.array([centre_of(pose) for pose in scene.cams_from_world])
    places = HOME.to_wgs84(centres + rng.normal(0, sigmas, centres.shape)).tolist()
    return {
        image_id: GeoPosition(*place, HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M)
        for image_id, place in enumerate(places, start=1)
    }


def write(file: Path, scene: SyntheticScene, positions: dict[int, GeoPosition]) -> None:
    with PhotoDatabase(file) as database:
        for image_id in range(1, len(scene) + 1):
            pairs = [
                true_pair(scene, image_id - 1, other - 1, (image_id, other))
                for other in range(1, image_id)
                if len(true_matches(scene, image_id - 1, other - 1)) >= MIN_SHARED_POINTS
            ]
            photo = described(scene, image_id - 1)
            database.write(image_id, photo, scene.camera, pairs, prior=positions.get(image_id))


def priors_in(file: Path) -> dict[int, pycolmap.PosePrior]:
    with pycolmap.Database.open(file) as database:
        return {prior.corr_data_id.id: prior for prior in database.read_all_pose_priors()}


def lost(position: GeoPosition) -> GeoPosition:
    """Without its altitude."""
    return GeoPosition(position.latitude_deg, position.longitude_deg, None, 0.1, 0.1)


def test_colmap_takes_the_covariance_as_metres_east_north_and_up(strip, tmp_path):
    file = tmp_path / "database.db"
    write(file, strip, positions_of(strip))
    options = pycolmap.DatabaseCacheOptions()
    options.convert_pose_priors_to_enu = True
    with pycolmap.Database.open(file) as database:
        priors = pycolmap.DatabaseCache.create(database, options).pose_priors
    assert len(priors) == NUM_PHOTOS
    variances = np.square([HORIZONTAL_SIGMA_M, HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M])
    for prior in priors:
        assert prior.coordinate_system == pycolmap.PosePriorCoordinateSystem.CARTESIAN
        np.testing.assert_allclose(prior.position_covariance, np.diag(variances), rtol=1e-12)


@pytest.mark.parametrize("spoilt", [[], [1], [1, 5, 6]])
def test_colmap_adjusts_to_priors_whichever_photo_has_none(strip, tmp_path, spoilt):
    """The frame is COLMAP's: that of the first prior, in metres."""
    file = tmp_path / "database.db"
    positions = positions_of(strip)
    for image_id in spoilt:
        positions[image_id] = lost(positions[image_id])
    write(file, strip, positions)
    assert priors_in(file).keys() == positions.keys() - set(spoilt)
    options = pycolmap.IncrementalPipelineOptions()
    options.use_prior_position = True
    options.random_seed = 1
    options.num_threads = 1
    models = pycolmap.incremental_mapping(file, tmp_path, tmp_path / "sparse", options)
    assert len(models) == 1
    first = positions[min(positions.keys() - set(spoilt))]
    assert first.altitude_m is not None
    frame = LocalFrame(first.latitude_deg, first.longitude_deg, first.altitude_m)
    assert models[0].num_reg_images() == NUM_PHOTOS
    centres = [centre_of(pose) for pose in strip.cams_from_world]
    truth = frame.to_enu(HOME.to_wgs84(np.array(centres)))
    for image_id, true_centre in enumerate(truth, start=1):
        found = models[0].images[image_id].projection_center()
        assert np.linalg.norm(found - true_centre) < POSITION_TOLERANCE_M


def test_what_cannot_be_a_prior_is_none(strip, tmp_path):
    file = tmp_path / "database.db"
    positions = positions_of(strip)
    positions[1] = GeoPosition(0.0, 0.0, 30.0, 5.0, 10.0)
    positions[2] = lost(positions[2])
    del positions[3]
    write(file, strip, positions)
    assert sorted(priors_in(file)) == list(range(4, NUM_PHOTOS + 1))


def test_an_accuracy_that_is_not_known_is_left_to_colmap(strip, tmp_path):
    file = tmp_path / "database.db"
    write(file, strip, {2: GeoPosition(47.0, 8.0, 500.0, 0.1, None)})
    (prior,) = priors_in(file).values()
    assert np.isnan(prior.position_covariance).all()


def test_priors_are_replaced_all_together(strip, tmp_path):
    file = tmp_path / "database.db"
    positions = positions_of(strip)
    write(file, strip, positions)
    better = GeoPosition(47.0, 8.0, 501.0, 0.01, 0.02)
    with PhotoDatabase(file) as database:
        database.write_priors({4: better, 5: lost(better), 999: better})
    priors = priors_in(file)
    assert list(priors) == [4]
    assert priors[4].position.ravel().tolist() == [47.0, 8.0, 501.0]
    np.testing.assert_allclose(np.diag(priors[4].position_covariance), [1e-4, 1e-4, 4e-4])
