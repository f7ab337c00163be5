"""Models on disk are found and read, and what is not one is named with a way out."""

from __future__ import annotations

import pytest
from helpers.model_building import looking, make_model

from sfm_front.errors import InputError
from sfm_front.storage.colmap_models import find_models, is_model, read_model


@pytest.fixture
def model():
    return make_model({"a.jpg": looking([0, 0, 0], [0, 1, 0], [0, 0, 1])})


@pytest.mark.parametrize("form", ["binary", "text"])
def test_reads_both_forms(tmp_path, model, form):
    model.write_binary(tmp_path) if form == "binary" else model.write_text(tmp_path)
    assert is_model(tmp_path)
    assert [image.name for image in read_model(tmp_path).images.values()] == ["a.jpg"]


def test_models_are_listed_by_number(tmp_path, model):
    for number in (0, 2, 10):
        (tmp_path / "sparse" / str(number)).mkdir(parents=True)
        model.write(tmp_path / "sparse" / str(number))
    assert [folder.name for folder in find_models(tmp_path)] == ["0", "2", "10"]


def test_a_folder_without_a_model_points_to_those_below_it(tmp_path, model):
    (tmp_path / "sparse" / "0").mkdir(parents=True)
    model.write(tmp_path / "sparse" / "0")
    with pytest.raises(InputError, match=r"try .*sparse.0$"):
        read_model(tmp_path)


def test_an_incomplete_model_is_none(tmp_path, model):
    model.write_binary(tmp_path)
    (tmp_path / "points3D.bin").unlink()
    with pytest.raises(InputError, match="no COLMAP model in it; expected cameras"):
        read_model(tmp_path)


def test_a_broken_model_is_refused_in_one_line(tmp_path, model):
    model.write_binary(tmp_path)
    (tmp_path / "cameras.bin").write_bytes(b"")
    with pytest.raises(InputError, match="broken COLMAP model") as error:
        read_model(tmp_path)
    assert "\n" not in str(error.value)


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        read_model(tmp_path / "nowhere")
