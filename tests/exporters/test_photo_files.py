"""Photos beside a model: which, under which names, and what the model says of them."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from helpers.export_scenes import (
    HEIGHT,
    PLAIN,
    WIDTH,
    camera,
    exact_model,
    job_of,
    smooth_picture,
    write_photos,
)
from PIL import Image

from sfm_front.errors import InputError
from sfm_front.exporters.photo_files import place_photos
from sfm_front.exporters.undistortion import Projection

HOSTILE = (
    "a b.png",
    "quo\"te's.png",
    "../../up.png",
    "left/1.png",
    "right/1.png",
    "left_1.png",
    "naïve 写.png",
    "esc\x1b[31m\n.png",
    "<script>.png",
)
EXACT_PX = 1e-6


def files(job):
    return sorted(path.name for path in (job.folder / "images").iterdir())


def names(job):
    model = job.scene.model
    return sorted(model.image(i).name for i in model.reg_image_ids())


@pytest.mark.parametrize("projection", list(Projection))
@pytest.mark.parametrize("threads", [1, 3])
def test_images_holds_exactly_the_models_photos_in_the_cameras_sizes(tmp_path, projection, threads):
    lenses = ("SIMPLE_RADIAL", "PINHOLE")
    model, photos = exact_model(lenses), write_photos(tmp_path / "photos")
    job = job_of(tmp_path, model, photos, threads=threads)
    assert place_photos(job, projection) == []
    assert files(job) == names(job) == sorted(PLAIN)
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        lens = model.camera(image.camera_id)
        size = Image.open(job.folder / "images" / image.name).size
        assert size == (lens.width, lens.height)
        if projection is not Projection.AS_TAKEN:
            assert lens.model_name == "PINHOLE"
    errors = model.compute_mean_reprojection_error(), *_errors(model)
    assert max(errors) < EXACT_PX


def _errors(model):
    """Between keypoints and where their points project, photo by photo."""
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        seen = [p for p in image.points2D if p.has_point3D()]
        assert len(seen) > 10
        points = np.array([model.point3D(p.point3D_id).xyz for p in seen])
        pixels = model.camera(image.camera_id).img_from_cam(image.cam_from_world() * points)
        yield np.abs(pixels - np.array([p.xy for p in seen])).max()


def test_a_photo_that_is_fine_is_copied_byte_by_byte_or_linked(tmp_path):
    photos = write_photos(tmp_path / "photos")
    for link in (False, True):
        (tmp_path / str(link)).mkdir()
        job = job_of(tmp_path / str(link), exact_model(), photos, link=link)
        place_photos(job, Projection.AS_TAKEN)
        for name, path in photos.items():
            placed = job.folder / "images" / name
            assert placed.is_symlink() == link
            assert placed.read_bytes() == path.read_bytes()


def test_a_photo_that_has_to_change_is_no_link(tmp_path):
    photos = write_photos(tmp_path / "photos")
    before = {path: path.read_bytes() for path in photos.values()}
    job = job_of(tmp_path, exact_model(), photos, link=True)
    place_photos(job, Projection.PINHOLE)
    assert not any(path.is_symlink() for path in (job.folder / "images").iterdir())
    assert {path: path.read_bytes() for path in photos.values()} == before


def test_hostile_names_stay_apart_and_inside(tmp_path):
    photos = write_photos(tmp_path / "photos", HOSTILE)
    job = job_of(tmp_path, exact_model(names=HOSTILE), photos)
    (note,) = place_photos(job, Projection.AS_TAKEN)
    assert note.startswith(f"{len(HOSTILE)} renamed")
    assert files(job) == names(job)
    assert len(set(files(job))) == len(HOSTILE)
    assert all(name.isascii() and name.isprintable() and " " not in name for name in files(job))
    assert {path.name for path in tmp_path.iterdir()} == {"photos", "export"}
    with (job.folder / "names.csv").open(newline="", encoding="utf-8") as file:
        told = {row["photo"]: row["file"] for row in csv.DictReader(file)}
    assert set(told) == set(HOSTILE)
    for name, path in photos.items():
        assert (job.folder / "images" / told[name]).read_bytes() == path.read_bytes()


def test_photos_that_are_gone_or_changed_are_left_out_and_named(tmp_path):
    taken = tuple(f"{letter}.png" for letter in "abcdef")
    photos = write_photos(tmp_path / "photos", taken)
    photos["a.png"].unlink()
    smooth_picture().resize((HEIGHT, WIDTH)).save(photos["b.png"])
    photos["c.png"].write_bytes(photos["c.png"].read_bytes()[:500])
    del photos["d.png"]
    job = job_of(tmp_path, exact_model(names=taken), photos)
    (note,) = place_photos(job, Projection.CENTRED_PINHOLE)
    assert note == (
        "4 left out: 'a.png' (not found), 'b.png' (is 150 x 200 now, was 200 x 150), "
        "'c.png' (truncated: the PNG data ends too soon) and 1 more"
    )
    assert files(job) == names(job) == ["e.png", "f.png"]
    assert job.scene.model.num_points3D() > 0


@pytest.mark.parametrize("damage", ["gone", "resized"])
def test_no_photo_at_all_is_refused_with_the_way_out(tmp_path, damage):
    photos = write_photos(tmp_path / "photos")
    for path in photos.values():
        path.unlink()
        if damage == "resized":
            smooth_picture().resize((50, 50)).save(path)
    with pytest.raises(InputError, match="--images"):
        place_photos(job_of(tmp_path, exact_model(), photos), Projection.PINHOLE)


def test_cameras_without_a_photo_are_pinholes_too(tmp_path):
    model = exact_model(("SIMPLE_RADIAL", "OPENCV"), PLAIN[:2])
    photos = write_photos(tmp_path / "photos", PLAIN[:2])
    photos["b.png"].unlink()
    model.add_camera_with_trivial_rig(camera("FULL_OPENCV", 9))
    place_photos(job_of(tmp_path, model, photos), Projection.PINHOLE)
    assert {lens.model_name for lens in model.cameras.values()} == {"PINHOLE"}


def test_a_jpeg_stays_a_jpeg_and_all_else_becomes_png(tmp_path):
    taken = ("a.JPG", "b.tif", "c.webp")
    photos = write_photos(tmp_path / "photos", taken)
    job = job_of(tmp_path, exact_model(names=taken), photos)
    place_photos(job, Projection.PINHOLE)
    assert files(job) == ["a.JPG", "b.png", "c.png"]
    kinds = {name: Image.open(job.folder / "images" / name).format for name in files(job)}
    assert kinds == {"a.JPG": "JPEG", "b.png": "PNG", "c.png": "PNG"}


def test_progress_counts_to_the_end(tmp_path):
    heard = []
    job = job_of(tmp_path, exact_model(), write_photos(tmp_path / "photos"))
    object.__setattr__(job, "on_progress", lambda done, total: heard.append((done, total)))
    place_photos(job, Projection.PINHOLE)
    assert heard == [(1, 3), (2, 3), (3, 3)]
