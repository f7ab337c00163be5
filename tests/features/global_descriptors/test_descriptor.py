"""Global vectors by name, and how parts are joined."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from sfm_front.errors import ConfigError, WeightsError
from sfm_front.features.global_descriptors import weights_download as weights_cache
from sfm_front.features.global_descriptors.descriptor import (
    NAMES,
    VLAD_WEIGHT,
    GlobalDescriptor,
    resolve,
)
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.types import Features

FLOAT32_NOISE = 1e-5


def features_of(descriptors: np.ndarray) -> Features:
    keypoints = np.ones((len(descriptors), 4), np.float32)
    return Features(keypoints, descriptors, np.zeros((len(descriptors), 3), np.uint8))


@dataclass
class Fake:
    """Describes anything by a random vector that its sum decides."""

    name: str
    dimension: int
    fingerprint: str = "fake:1"

    def describe(self, source: np.ndarray | Features) -> np.ndarray:
        values = source.descriptors if isinstance(source, Features) else source
        if values.size == 0:
            return np.zeros(self.dimension, np.float32)
        generator = np.random.default_rng(int(values.sum()) + self.dimension)
        return unit_length(generator.normal(size=self.dimension).astype(np.float32))


NETWORK, LOCAL = Fake("network", 20), Fake("local", 30)
PIXELS = [np.full((4, 5, 3), value, np.uint8) for value in (1, 2)]
FEATURES = [features_of(np.full((6, 128), value, np.uint8)) for value in (3, 4)]
NO_FEATURES = features_of(np.zeros((0, 128), np.uint8))


@pytest.mark.parametrize("vlad_weight", [VLAD_WEIGHT, 0.3])
def test_the_cosine_of_joined_vectors_is_the_weighted_mean_of_cosines(vlad_weight):
    joined = GlobalDescriptor(networks=[NETWORK], local=[LOCAL], vlad_weight=vlad_weight)
    first, second = (joined.describe(*pair) for pair in zip(PIXELS, FEATURES, strict=True))
    of_network = NETWORK.describe(PIXELS[0]) @ NETWORK.describe(PIXELS[1])
    of_local = LOCAL.describe(FEATURES[0]) @ LOCAL.describe(FEATURES[1])
    assert first @ second == pytest.approx(
        (1 - vlad_weight) * of_network + vlad_weight * of_local, abs=FLOAT32_NOISE
    )
    assert first @ first == pytest.approx(1.0, abs=FLOAT32_NOISE)


def test_two_networks_count_the_same():
    other = Fake("other", 10)
    joined = GlobalDescriptor(networks=[NETWORK, other])
    vector = joined.describe(PIXELS[0], FEATURES[0])
    assert np.linalg.norm(vector[:20]) == pytest.approx(np.linalg.norm(vector[20:]), abs=1e-5)
    assert vector.shape == (30,)


def test_shares_computed_apart_join_to_the_same_vector():
    joined = GlobalDescriptor(networks=[NETWORK], local=[LOCAL])
    apart = joined.join(joined.describe_pixels(PIXELS[0]), joined.describe_local(FEATURES[0]))
    np.testing.assert_array_equal(apart, joined.describe(PIXELS[0], FEATURES[0]))
    assert joined.name == "network+local"
    assert joined.fingerprint == f"fake:1+fake:1:vlad_weight={VLAD_WEIGHT}"
    assert joined.dimension == 50 == len(apart)
    assert apart.dtype == np.float32
    assert joined.needs_pixels


def test_the_weight_changes_the_fingerprint_if_it_changes_the_vector():
    def fingerprints(**parts: list[Fake]) -> set[str]:
        return {GlobalDescriptor(**parts, vlad_weight=w).fingerprint for w in (0.5, 0.8)}

    assert len(fingerprints(networks=[NETWORK], local=[LOCAL])) == 2
    assert len(fingerprints(networks=[NETWORK])) == len(fingerprints(local=[LOCAL])) == 1


@pytest.mark.parametrize("vlad_weight", [0.0, 1.0, -1.0, float("nan")])
def test_a_weight_that_leaves_a_part_out_is_refused(vlad_weight):
    with pytest.raises(ConfigError, match="vlad_weight must be above 0 and below 1, got"):
        resolve("vlad", vlad_weight=vlad_weight)


def test_a_photo_without_features_is_still_described_by_the_network():
    joined = GlobalDescriptor(networks=[NETWORK], local=[LOCAL])
    vector = joined.describe(PIXELS[0], NO_FEATURES)
    np.testing.assert_allclose(vector[:20], NETWORK.describe(PIXELS[0]), atol=FLOAT32_NOISE)
    assert not vector[20:].any()


def test_vlad_alone_needs_no_pixels():
    descriptor, message = resolve("vlad")
    assert message is None
    assert not descriptor.needs_pixels
    assert descriptor.describe_pixels(PIXELS[0]).shape == (0,)
    features = features_of(np.random.default_rng(0).integers(0, 256, (50, 128), dtype=np.uint8))
    np.testing.assert_allclose(
        descriptor.describe(PIXELS[0], features),
        Vlad().describe(features),
        atol=FLOAT32_NOISE,
    )


@pytest.mark.parametrize("name", ["vlat", "", "vlad+", "vlad+resnet", "auto+vlad"])
def test_an_unknown_name_lists_those_that_exist(name):
    with pytest.raises(ConfigError) as caught:
        resolve(name)
    assert all(valid in str(caught.value) for valid in (*NAMES, "auto"))


def test_a_part_named_twice_is_refused():
    with pytest.raises(ConfigError, match="twice"):
        resolve("vlad+vlad")


@pytest.mark.parametrize("name", ["vlad", "alexnet_fc7+mobilenet_v2"])
def test_a_weights_file_needs_exactly_one_network(name):
    with pytest.raises(ConfigError, match="--weights goes with one network"):
        resolve(name, weights=Path("file.pth"))


def test_a_weights_file_that_is_wrong_is_an_error_under_auto_too(tmp_path):
    with pytest.raises(WeightsError, match=r"absent\.pth"):
        resolve("auto", weights=tmp_path / "absent.pth")


@pytest.fixture
def no_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(url: str, **_: object) -> Path:
        raise WeightsError(f"{weights_cache.file_name(url)} cannot be downloaded")

    monkeypatch.setattr(weights_cache, "cached_or_fetched", fail)


@pytest.mark.usefixtures("no_weights")
def test_auto_without_weights_is_vlad_and_says_why():
    descriptor, message = resolve("auto")
    assert descriptor.name == "vlad"
    assert message is not None
    assert "resnet101-63fe2227.pth cannot be downloaded" in message
    assert "\n" not in message


@pytest.mark.usefixtures("no_weights")
def test_a_network_asked_for_by_name_is_an_error_without_weights():
    with pytest.raises(WeightsError, match="mobilenet_v2-b0353104"):
        resolve("vlad+mobilenet_v2")


def test_networks_are_loaded_from_the_cache(tmp_path, monkeypatch):
    import torch

    from sfm_front.features.global_descriptors.networks import ResNet101

    torch.manual_seed(0)
    file = tmp_path / "resnet101.pth"
    torch.save(ResNet101().state_dict(), file)
    monkeypatch.setattr(weights_cache, "cached_or_fetched", lambda *_, **__: file)
    descriptor, message = resolve("auto", vlad_weight=0.7)
    assert descriptor.name == "resnet101_pool5+vlad"
    assert descriptor.fingerprint.endswith(":vlad_weight=0.7")
    assert message == "global descriptor: resnet101_pool5+vlad, with torchvision's weights"
    assert descriptor.dimension == 2048 + Vlad().dimension


def test_torch_is_loaded_only_for_a_network():
    program = (
        "import sys, numpy as np\n"
        "from sfm_front.features.global_descriptors.descriptor import resolve\n"
        "from sfm_front.types import Features\n"
        "ones = np.ones((3, 128), np.uint8)\n"
        "features = Features(np.ones((3, 4), np.float32), ones, ones[:, :3])\n"
        "resolve('vlad')[0].describe(None, features)\n"
        "assert 'torch' not in sys.modules, 'torch was loaded'\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
