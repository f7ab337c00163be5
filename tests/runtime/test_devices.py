"""Which device is used, and what is said where it is not the one asked for."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from sfm_front.errors import ConfigError
from sfm_front.runtime import devices
from sfm_front.runtime.devices import usable_device


@pytest.fixture
def machine(monkeypatch):
    """A machine with or without a driver, whose torch can or cannot use the GPU."""

    def set_up(*, driver: bool, usable: bool) -> None:
        monkeypatch.setattr(devices, "_has_driver", lambda: driver)
        torch = SimpleNamespace(cuda=SimpleNamespace(is_available=lambda: usable))
        monkeypatch.setitem(sys.modules, "torch", torch)

    return set_up


@pytest.mark.parametrize("name", ["auto", "cuda"])
def test_a_gpu_that_can_be_used_is_used(machine, name):
    machine(driver=True, usable=True)
    assert usable_device(name) == ("cuda", None)


def test_the_cpu_can_be_asked_for_beside_a_gpu(machine):
    machine(driver=True, usable=True)
    assert usable_device("cpu") == ("cpu", None)


@pytest.mark.parametrize(
    ("driver", "why"), [(False, "no NVIDIA driver"), (True, "this PyTorch cannot use the GPU")]
)
def test_without_a_gpu_the_cpu_does_it_and_one_line_says_so(machine, driver, why):
    machine(driver=driver, usable=False)
    device, message = usable_device("cuda")
    assert device == "cpu"
    assert why in message
    assert message.endswith("running on the CPU")
    assert "\n" not in message
    assert usable_device("auto") == ("cpu", None)


def test_torch_is_not_loaded_where_there_is_no_driver(monkeypatch):
    monkeypatch.setattr(devices, "_has_driver", lambda: False)
    # Importing this would raise ImportError.
    monkeypatch.setitem(sys.modules, "torch", None)
    assert usable_device("auto") == ("cpu", None)


def test_a_torch_that_cannot_be_loaded_is_no_crash(monkeypatch):
    monkeypatch.setattr(devices, "_has_driver", lambda: True)
    monkeypatch.setitem(sys.modules, "torch", None)
    device, message = usable_device("cuda")
    assert device == "cpu"
    assert "torch cannot be loaded" in message


def test_other_names_are_refused():
    with pytest.raises(ConfigError, match="device must be one of auto, cpu, cuda, got 'tpu'"):
        usable_device("tpu")
