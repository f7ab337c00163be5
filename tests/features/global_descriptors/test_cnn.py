"""The networks and what they are shown; their faithfulness is proved in tests/real."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from sfm_front.errors import ConfigError, WeightsError
from sfm_front.features.global_descriptors import networks
from sfm_front.features.global_descriptors.cnn import (
    MEAN_RGB,
    NETWORKS,
    STD_RGB,
    CnnDescriptor,
    preprocess,
)

# torchvision documents these.
PARAMETERS = {"alexnet_fc7": 61_100_840, "resnet101_pool5": 44_549_160, "mobilenet_v2": 3_504_872}


def on_meta(name: str) -> networks.DescriptorNetwork:
    with torch.device("meta"):
        return getattr(networks, NETWORKS[name].class_name)().eval()


@pytest.mark.parametrize("name", NETWORKS)
def test_the_networks_have_torchvisions_size_and_the_stated_dimension(name):
    network = on_meta(name)
    assert sum(parameter.numel() for parameter in network.parameters()) == PARAMETERS[name]
    assert NETWORKS[name].dimension == network.DIMENSION
    # Parameters of any value: only the shape is looked at.
    described = network.to_empty(device="cpu")(torch.zeros(2, 3, 64, 96))
    assert described.shape == (2, network.DIMENSION)
    assert any(key.startswith(network.HEAD) for key in network.state_dict())


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    file = tmp_path_factory.mktemp("weights") / "random.pth"
    torch.save(networks.MobileNetV2().state_dict(), file)
    return file


def random_pixels(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


@pytest.mark.parametrize("size", [(480, 640), (640, 480), (1, 1), (2000, 16), (32, 32)])
def test_photos_of_any_size_become_a_vector_of_length_1(weights, size):
    vector = CnnDescriptor("mobilenet_v2", weights=weights).describe(random_pixels(*size))
    assert vector.shape == (1280,)
    assert vector.dtype == np.float32
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=1e-5)


def test_the_vector_is_the_networks_output_for_the_prepared_photo(weights):
    pixels = random_pixels(100, 120)
    network = networks.MobileNetV2().eval()
    network.load_state_dict(torch.load(weights, weights_only=True))
    with torch.inference_mode():
        expected = network(torch.from_numpy(preprocess(pixels, 320)))[0].numpy()
    vector = CnnDescriptor("mobilenet_v2", weights=weights).describe(pixels)
    np.testing.assert_allclose(vector, expected / np.linalg.norm(expected), rtol=1e-4, atol=1e-6)


def test_a_small_photo_is_only_normalised():
    pixels = random_pixels(70, 90)
    batch = preprocess(pixels, 320)
    assert batch.shape == (1, 3, 70, 90)
    restored = batch[0].transpose(1, 2, 0) * STD_RGB + MEAN_RGB
    np.testing.assert_allclose(restored * 255, pixels, atol=1e-3)


def test_a_large_photo_is_reduced_whole():
    pixels = np.zeros((600, 900, 3), np.uint8)
    pixels[:, 450:, 0] = 255
    batch = preprocess(pixels, 300)
    assert batch.shape == (1, 3, 200, 300)
    red = batch[0, 0] * STD_RGB[0] + MEAN_RGB[0]
    np.testing.assert_allclose(red[:, :150], 0, atol=1e-5)
    np.testing.assert_allclose(red[:, 150:], 1, atol=1e-5)


def test_a_strip_keeps_enough_height_for_every_network():
    assert preprocess(random_pixels(20, 2000), 320).shape == (1, 3, 64, 320)


def test_weights_of_another_network_are_refused(weights):
    with pytest.raises(WeightsError, match="resnet101-63fe2227"):
        CnnDescriptor("resnet101_pool5", weights=weights)


def test_a_device_that_is_not_there_is_one_clear_line(weights):
    with pytest.raises(ConfigError, match="device 'abacus' cannot be used"):
        CnnDescriptor("mobilenet_v2", weights=weights, device="abacus")


def test_other_weights_have_another_fingerprint(weights, tmp_path):
    torch.manual_seed(1)
    other = tmp_path / "other.pth"
    torch.save(networks.MobileNetV2().state_dict(), other)
    first, again, second = (
        CnnDescriptor("mobilenet_v2", weights=file).fingerprint
        for file in (weights, weights, other)
    )
    assert first == again != second
