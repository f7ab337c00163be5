"""Published datasets in their layout, and scene pools: what is read, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from helpers.model_building import model_of
from PIL import Image

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run
from sfm_front.evaluation.retrieval import reference_models, specs
from sfm_front.evaluation.retrieval.datasets import holidays, oxford, pool, revisited
from sfm_front.evaluation.retrieval.datasets.plain_pickle import read_plain_pickle
from sfm_front.evaluation.retrieval.datasets.registry import PUBLISHED


def photos(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"")  # nobody opens them here


def oxford_lists(folder, name="tower_1", photo="oxc1_tower_01", good="tower_01", ok="", junk=""):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}_query.txt").write_text(f"{photo} 1 2.5 30 40\n")
    for kind, names in (("good", good), ("ok", ok), ("junk", junk)):
        (folder / f"{name}_{kind}.txt").write_text("".join(f"{n}\n" for n in names.split()))


# Holidays


def test_holidays_by_number(tmp_path):
    photos(tmp_path / "jpg", "100000.jpg", "100001.jpg", "100002.jpg", "100100.jpg", "100101.jpg")
    listed = tmp_path / holidays.LIST_FILE
    listed.write_text("100000.jpg\n100001.jpg\n100002.jpg\n100100.jpg\n100101.jpg\n")
    (dataset,) = holidays.load(tmp_path)
    assert dataset.photos["100002.jpg"] == tmp_path / "jpg" / "100002.jpg"
    first, second = dataset.queries
    assert (first.photo, first.relevant) == ("100000.jpg", {"100001.jpg", "100002.jpg"})
    assert first.ignored == {"100000.jpg"}
    assert (second.photo, second.relevant) == ("100100.jpg", {"100101.jpg"})


def test_holidays_half_there(tmp_path):
    photos(tmp_path / "jpg", "100000.jpg", "100001.jpg")
    with pytest.raises(InputError, match=r"2 of 1491 photos of Holidays .* get them from https"):
        holidays.load(tmp_path)
    (tmp_path / holidays.LIST_FILE).write_text("100000.jpg\n100001.jpg\n100002.jpg\n")
    with pytest.raises(InputError, match=r"2 of 3 photos of Holidays are there \(100002 missing\)"):
        holidays.load(tmp_path)


# Oxford and Paris


def test_oxford_lists_and_prefix(tmp_path):
    photos(tmp_path / "images", "tower_01.jpg", "tower_02.jpg", "tower_03.jpg", "other.jpg")
    oxford_lists(tmp_path / "gt", good="tower_01 tower_01", ok="tower_02", junk="tower_03")
    (dataset,) = oxford.load(tmp_path, "oxford5k", 4, "https://x (y)")
    (query,) = dataset.queries
    assert (query.name, query.photo, query.box) == ("tower_1", "tower_01", (1, 2.5, 30, 40))
    assert query.relevant == {"tower_01", "tower_02"}  # the official count has the query in it
    assert query.ignored == {"tower_03"}
    assert set(dataset.photos) == {"tower_01", "tower_02", "tower_03", "other"}


def test_paris_is_in_folders_and_has_broken_photos(tmp_path):
    broken = "paris_louvre_000136"
    photos(tmp_path / "paris" / "louvre", f"{broken}.jpg", "paris_louvre_000001.jpg")
    photos(tmp_path / "paris" / "eiffel", "paris_eiffel_000001.jpg")
    oxford_lists(tmp_path, "louvre_1", "paris_louvre_000001", good=f"paris_louvre_000001 {broken}")
    (dataset,) = oxford.load(tmp_path, "paris6k", 2, "https://x (y)")
    assert set(dataset.photos) == {"paris_louvre_000001", "paris_eiffel_000001"}
    assert dataset.queries[0].relevant == {"paris_louvre_000001"}
    assert len(oxford.CORRUPT_PARIS) == 20


def test_oxford_that_lacks_a_part(tmp_path):
    photos(tmp_path / "images", "tower_01.jpg")
    with pytest.raises(InputError, match="ground truth of oxford5k is missing"):
        oxford.load_oxford5k(tmp_path)
    oxford_lists(tmp_path, good="tower_01 tower_02")
    with pytest.raises(InputError, match="1 of 5063 photos of oxford5k"):
        oxford.load_oxford5k(tmp_path)
    with pytest.raises(InputError, match=r"1 of 2 photos of small .*tower_02 missing"):
        oxford.load(tmp_path, "small", 1, "https://x (y)")
    (tmp_path / "tower_1_junk.txt").unlink()
    with pytest.raises(InputError, match=r"tower_1_junk.txt: missing"):
        oxford.load_oxford5k(tmp_path)
    (tmp_path / "tower_1_query.txt").write_text("tower_01 1 2 3\n")
    with pytest.raises(InputError, match="four sides of a box"):
        oxford.load_oxford5k(tmp_path)


# Revisited


ANNOTATION = {
    "imlist": ["a", "b", "c", "d", "e"],
    "qimlist": ["q", "r"],
    "gnd": [
        {"bbx": [1.0, 2.0, 3.0, 4.0], "easy": [0], "hard": [1, 2], "junk": [3]},
        {"bbx": [0, 0, 9, 9], "easy": np.array([4]), "hard": np.array([], int), "junk": []},
    ],
}


def test_revisited_in_three_difficulties(tmp_path):
    photos(tmp_path / "jpg", *(f"{name}.jpg" for name in "abcdeqr"))
    (tmp_path / "gnd_roxford5k.pkl").write_bytes(pickle.dumps(ANNOTATION, protocol=2))
    easy, medium, hard = revisited.load_roxford5k(tmp_path)
    assert [d.name for d in (easy, medium, hard)] == [
        "roxford5k easy", "roxford5k medium", "roxford5k hard",
    ]  # fmt: skip
    assert set(easy.photos) == set("abcde")
    assert set(easy.query_photos) == set("qr")
    assert [q.relevant for q in easy.queries] == [{"a"}, {"e"}]
    assert [q.ignored for q in easy.queries] == [{"b", "c", "d"}, set()]
    assert [q.relevant for q in medium.queries] == [{"a", "b", "c"}, {"e"}]
    assert [q.ignored for q in medium.queries] == [{"d"}, set()]
    assert [q.relevant for q in hard.queries] == [{"b", "c"}, set()]
    assert [q.ignored for q in hard.queries] == [{"a", "d"}, {"e"}]
    assert easy.queries[0].box == (1, 2, 3, 4)


def test_revisited_that_lacks_a_part(tmp_path):
    photos(tmp_path / "jpg", *(f"{name}.jpg" for name in "abcdq"))
    with pytest.raises(InputError, match=r"no gnd_rparis6k.pkl; get it from http"):
        revisited.load_rparis6k(tmp_path)
    file = tmp_path / "gnd_rparis6k.pkl"
    file.write_bytes(pickle.dumps(ANNOTATION))
    with pytest.raises(InputError, match=r"5 of 7 photos of rparis6k are there \(e, r missing\)"):
        revisited.load_rparis6k(tmp_path)
    for wrong in ([1, 2], {"imlist": ["a"], "qimlist": ["q"], "gnd": [{"bbx": [1, 2, 3, 4]}]}):
        file.write_bytes(pickle.dumps(wrong))
        with pytest.raises(InputError, match="not the annotation of a revisited dataset"):
            revisited.load_rparis6k(tmp_path)


class Dangerous:
    def __init__(self, witness):
        self.witness = witness

    def __reduce__(self):
        return (open, (str(self.witness), "w"))


@pytest.mark.parametrize("protocol", [2, 4])
def test_a_pickle_runs_nothing(tmp_path, protocol):
    file, witness = tmp_path / "bad.pkl", tmp_path / "witness"
    file.write_bytes(pickle.dumps({"gnd": Dangerous(witness)}, protocol=protocol))
    with pytest.raises(InputError, match="more than plain data"):
        read_plain_pickle(file)
    assert not witness.exists()


@pytest.mark.parametrize("protocol", [2, 3, 4])
def test_a_pickle_of_arrays_is_read(tmp_path, protocol):
    file = tmp_path / "good.pkl"
    content = {
        "a": np.arange(6).reshape(2, 3),
        "none": np.zeros(0),
        "b": [np.float64(0.5), "text", (1, None)],
    }
    file.write_bytes(pickle.dumps(content, protocol=protocol))
    read = read_plain_pickle(file)
    np.testing.assert_array_equal(read["a"], content["a"])
    assert read["b"] == content["b"]
    assert read["none"].shape == (0,)


def test_a_damaged_pickle_is_refused_in_a_line(tmp_path):
    file = tmp_path / "cut.pkl"
    file.write_bytes(pickle.dumps(ANNOTATION)[:-20])
    with pytest.raises(InputError, match="download it again") as caught:
        read_plain_pickle(file)
    assert "\n" not in str(caught.value)


# Pools


def scene(home, *names, models=()):
    (home / "images").mkdir(parents=True)
    for name in names:
        Image.new("RGB", (8, 8)).save(home / "images" / name)
    for number, model in enumerate(models):
        folder = home / "sparse" / str(number)
        folder.mkdir(parents=True)
        model.write(folder)


THREE = 3 * [("a.png", "b.png")]
TWO = 2 * [("b.png", "c.png")]


def test_points_in_common_are_counted(monkeypatch):
    monkeypatch.setattr(pool, "_BLOCK", 2)  # so that a model takes several
    names, shared = pool.shared_points(model_of([*THREE, *TWO, ("a.png", "b.png", "c.png")]))
    assert names == ["a.png", "b.png", "c.png"]
    np.testing.assert_array_equal(shared, [[4, 4, 1], [4, 6, 3], [1, 3, 3]])


def test_a_pool_takes_relevance_from_any_model(tmp_path):
    first = [model_of(THREE), model_of([*TWO, ("b.png", "c.png")])]
    scene(tmp_path / "one", "a.png", "b.png", "c.png", "alone.png", models=first)
    scene(tmp_path / "two", "a.png", "b.png", models=[model_of(THREE)])
    (tmp_path / "no scene").mkdir()
    scenes = pool.find_scenes(tmp_path)
    dataset = pool.load(scenes, "pool", min_shared=3)
    assert len(dataset.photos) == 6
    answers = {query.name: query.relevant for query in dataset.queries}
    assert answers == {
        "one/a.png": {"one/b.png"},
        "one/b.png": {"one/a.png", "one/c.png"},
        "one/c.png": {"one/b.png"},
        "two/a.png": {"two/b.png"},
        "two/b.png": {"two/a.png"},
    }
    assert all(query.ignored == {query.photo} for query in dataset.queries)


def test_one_scene_is_a_pool(tmp_path):
    scene(tmp_path / "one", "a.png", "b.png", models=[model_of(THREE)])
    (found,) = pool.find_scenes(tmp_path / "one")
    assert found.name == "one"
    assert len(pool.load([found], "pool", 3).queries) == 2
    with pytest.raises(InputError, match="no two photos share 4 points"):
        pool.load([found], "pool", 4)


def test_folders_that_are_no_pool(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        pool.find_scenes(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no scene in it"):
        pool.find_scenes(tmp_path)


# Reference models


SETTINGS = BenchmarkSettings(threads=1)


@pytest.fixture
def scenes(tmp_path):
    scene(tmp_path / "pool" / "one", "a.png", "b.png")
    return pool.find_scenes(tmp_path / "pool")


def test_models_of_a_benchmark_are_found(tmp_path, scenes):
    folder = tmp_path / "keep" / "one" / "exhaustive" / "0" / "sparse" / "0"
    folder.mkdir(parents=True)
    model_of(THREE).write(folder)
    (found,) = reference_models.with_models(scenes, tmp_path / "keep", SETTINGS, pytest.fail)
    assert found.models == (folder,)


def test_models_that_lack_are_built_once(tmp_path, scenes, monkeypatch):
    built, notes = [], []

    def rival(name, photos, workspace, settings):
        built.append((name, photos, settings.threads))
        folder = workspace / "sparse" / "0"
        folder.mkdir(parents=True)
        model_of(THREE).write(folder)
        return Run(wall_seconds=1.0, peak_memory_bytes=None, models=(folder,))

    monkeypatch.setattr(reference_models, "run_rival", rival)
    keep = tmp_path / "keep"
    leftover = keep / "one" / "exhaustive.unfinished" / "0"
    leftover.mkdir(parents=True)
    for _ in range(2):
        (found,) = reference_models.with_models(scenes, keep, SETTINGS, notes.append)
        assert found.models == (keep / "one" / "exhaustive" / "0" / "sparse" / "0",)
    assert built == [("exhaustive", scenes[0].photos, 1)]
    assert len(notes) == 1
    assert not leftover.exists()


def test_a_scene_without_any_model_says_so(tmp_path, scenes, monkeypatch):
    def rival(_name, _photos, workspace, _settings):
        workspace.mkdir(parents=True)
        return Run(wall_seconds=1.0, peak_memory_bytes=None, failure="no initial pair")

    monkeypatch.setattr(reference_models, "run_rival", rival)
    notes = []
    (found,) = reference_models.with_models(scenes, tmp_path / "keep", SETTINGS, notes.append)
    assert found.models == ()
    assert "no reference model, so its photos are distractors only" in notes[-1]
    with pytest.raises(InputError, match=r"no reference model of one; .*--models DIR"):
        reference_models.with_models(scenes, None, SETTINGS, notes.append)


# Names on the command line


@pytest.mark.parametrize("spec", ["photos", "pool:", ":folder", "imagenet:folder"])
def test_datasets_are_named_by_kind_and_folder(spec):
    with pytest.raises(ConfigError, match="KIND:FOLDER; kinds are pool, holidays"):
        specs.load(spec, models=None, min_shared=20, threads=1, note=pytest.fail)


@pytest.mark.parametrize("kind", PUBLISHED)
def test_every_published_dataset_says_what_lacks(tmp_path, kind):
    photos(tmp_path, "one.jpg")
    with pytest.raises(InputError) as caught:
        specs.load(f"{kind}:{tmp_path}", models=None, min_shared=20, threads=1, note=pytest.fail)
    assert "http" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_pool_is_named_after_its_folder(tmp_path):
    scene(tmp_path / "mine" / "one", "a.png", "b.png", models=[model_of(THREE)])
    spec = f"pool:{tmp_path / 'mine'}"
    (dataset,) = specs.load(spec, models=None, min_shared=3, threads=1, note=pytest.fail)
    assert dataset.name == "pool mine"
