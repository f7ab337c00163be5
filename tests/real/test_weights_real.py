"""Our networks against torchvision's outputs, and the loader against real files."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch
from helpers.locations import SHARED

from sfm_front.errors import WeightsError
from sfm_front.features.global_descriptors import networks
from sfm_front.features.global_descriptors.cnn import NETWORKS, CnnDescriptor
from sfm_front.features.global_descriptors.weights import load_weights

FOLDER = SHARED / "weights"
RELATIVE_ERROR = 1e-4

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOLDER.is_dir(), reason="needs ../shared/weights"),
]


@pytest.fixture(scope="module")
def fill() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fill", FOLDER / "fill.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reference() -> dict[str, np.ndarray]:
    with np.load(FOLDER / "reference_outputs.npz") as arrays:
        return dict(arrays)


def network_of(name: str, file: Path) -> networks.DescriptorNetwork:
    """Built and loaded the way the package does it."""
    with torch.device("meta"):
        network = getattr(networks, NETWORKS[name].class_name)()
    load_weights(network, file, expected="the official file", device=torch.device("cpu"))
    return network.eval()


def relative_error(network, batch: torch.Tensor, expected: np.ndarray) -> float:
    with torch.inference_mode():
        output = network(batch).numpy()
    assert output.shape == expected.shape
    return float(np.abs(output - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("alexnet_fc7", "alexnet_fc7"),
        ("resnet101_pool5", "resnet101_pool5"),
        ("mobilenet_v2", "mobilenet_v2_pool"),
    ],
)
def test_a_network_gives_what_torchvisions_gives(name, key, fill, reference, tmp_path):
    names_and_shapes = getattr(networks, NETWORKS[name].class_name)().state_dict()
    file = tmp_path / "filled.pth"
    torch.save(fill.filled(names_and_shapes), file)
    network = network_of(name, file)
    assert relative_error(network, fill.test_input(), reference[key]) < RELATIVE_ERROR


def test_the_real_file_without_classifier_gives_what_torchvision_gives(fill, reference):
    network = network_of("mobilenet_v2", FOLDER / "mobilenet_v2-trunk.pth")
    expected = reference["mobilenet_v2_pool_trunk_file"]
    assert relative_error(network, fill.test_input(), expected) < RELATIVE_ERROR


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize(
    ("file", "what"),
    [
        ("wrong_network-squeezenet1_1.pth", "not weights of"),
        ("truncated-resnet18.pth", "cannot be read"),
        ("nested-dataparallel-resnet56-cifar.th", "not weights of"),
    ],
)
def test_files_that_are_not_the_networks_are_refused_in_one_line(name, file, what):
    with pytest.raises(WeightsError, match=what) as caught:
        CnnDescriptor(name, weights=FOLDER / "refuse" / file)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert NETWORKS[name].weights_url.rsplit("/", 1)[-1] in message
    assert "\n" not in message


def test_missing_layers_of_the_real_file_are_named(tmp_path):
    state = torch.load(FOLDER / "mobilenet_v2-trunk.pth", weights_only=True)
    del state["features.18.0.weight"], state["features.4.conv.2.weight"]
    file = tmp_path / "holes.pth"
    torch.save(state, file)
    with pytest.raises(WeightsError) as caught:
        CnnDescriptor("mobilenet_v2", weights=file)
    assert str(caught.value) == (
        "holes.pth: 2 layers missing (features.4.conv.2.weight, features.18.0.weight). "
        "Expected torchvision's mobilenet_v2-b0353104.pth."
    )
