"""What a session holds in memory of its photos."""

from __future__ import annotations

import weakref

from helpers.feature_making import features_of, random_descriptors
from helpers.photo_stream import described

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.photos.cameras import CameraCatalog, CameraOptions
from sfm_front.session.catalog import PhotoCatalog
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session


def test_forgotten_features_are_read_again():
    stored = features_of(random_descriptors(5))
    asked = []

    def read(image_id: int):
        asked.append(image_id)
        return stored

    catalog = PhotoCatalog(CameraCatalog(CameraOptions(), lambda _: ""), read, 2**20)
    photo = described(make_scene(2, 50, seed=0), 0)
    catalog.admit(photo)
    assert catalog[1].features is photo.features
    held = weakref.ref(photo.features.descriptors)
    assert asked == []
    catalog.forget_features()
    del photo
    assert held() is None
    assert catalog[1].features is stored
    assert catalog[1].features is stored
    assert asked == [1]
    assert list(catalog.colors) == [1]


def test_a_session_holds_no_features_while_it_adjusts_a_last_time(tmp_path, monkeypatch):
    scene = make_scene(8, 250, seed=1, layout="orbit")
    options = SessionOptions(global_descriptor="vlad", threads=1)
    forgotten = []
    forget = PhotoCatalog.forget_features
    monkeypatch.setattr(
        PhotoCatalog, "forget_features", lambda self: forgotten.append(len(self)) or forget(self)
    )
    with Session(tmp_path / "out", options) as session:
        for index in range(len(scene)):
            session.add_extracted(described(scene, index))
        assert forgotten == []
        session.finish()
    assert forgotten == [8]
