"""Weights files: fetched once, checked, and refused with one line where they do not fit."""

from __future__ import annotations

import hashlib
import socket
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import torch
from torch import Tensor

from sfm_front.errors import WeightsError
from sfm_front.features.global_descriptors import weights_download as weights_cache
from sfm_front.features.global_descriptors.networks import MobileNetV2
from sfm_front.features.global_descriptors.weights import load_weights

EXPECTED = "mobilenet_v2-b0353104.pth"
CPU = torch.device("cpu")
CONTENT = b"not really weights" * 1000


@pytest.fixture(scope="module")
def state() -> dict[str, Tensor]:
    torch.manual_seed(0)
    return MobileNetV2().state_dict()


def empty_network() -> MobileNetV2:
    with torch.device("meta"):
        return MobileNetV2().eval()


def saved(content: object, folder: Path) -> Path:
    file = folder / "given.pth"
    torch.save(content, file)
    return file


def without(state: dict[str, Tensor], *prefixes: str) -> dict[str, Tensor]:
    return {name: tensor for name, tensor in state.items() if not name.startswith(prefixes)}


def refusal(content: object, folder: Path) -> str:
    with pytest.raises(WeightsError) as caught:
        load_weights(empty_network(), saved(content, folder), expected=EXPECTED, device=CPU)
    message = str(caught.value)
    assert "\n" not in message
    assert EXPECTED in message
    assert "given.pth" in message
    return message


@pytest.mark.parametrize(
    "wrap",
    [
        lambda state: state,
        lambda state: {"epoch": 3, "state_dict": state},
        lambda state: {"state_dict": {f"module.{name}": value for name, value in state.items()}},
        lambda state: without(state, "classifier."),
        lambda state: {n: v for n, v in state.items() if not n.endswith("num_batches_tracked")},
        lambda state: {**state, "classifier.1.weight": torch.zeros(10, 1280)},
        lambda state: {n: v.half() if v.is_floating_point() else v for n, v in state.items()},
    ],
    ids=["plain", "nested", "parallel", "no head", "no counts", "other head", "half precision"],
)
def test_every_usual_wrapping_gives_the_same_network(wrap, state, tmp_path):
    network = empty_network()
    load_weights(network, saved(wrap(state), tmp_path), expected=EXPECTED, device=CPU)
    reference = MobileNetV2().eval()
    reference.load_state_dict(state)
    batch = torch.rand(1, 3, 64, 64, generator=torch.Generator().manual_seed(1))
    with torch.inference_mode():
        # Half precision keeps 11 bits, and 52 layers add up what that loses.
        assert torch.allclose(network(batch), reference(batch), rtol=0.05, atol=0.01)
        assert network(batch).dtype == torch.float32


def test_missing_layers_are_named_and_counted(state, tmp_path):
    message = refusal(without(state, "features.18.1.bias", "features.3."), tmp_path)
    assert "16 layers missing (features.3.conv.0.0.weight, " in message
    one = refusal(without(state, "features.18.1.bias"), tmp_path)
    assert "1 layer missing (features.18.1.bias)" in one


def test_layers_of_another_shape_are_refused(state, tmp_path):
    changed = {**state, "features.0.0.weight": torch.zeros(16, 3, 3, 3)}
    assert "1 layer of another shape (features.0.0.weight)" in refusal(changed, tmp_path)


def test_a_deeper_relative_is_refused(state, tmp_path):
    deeper = {**state, "features.19.0.weight": torch.zeros(4)}
    assert "1 layer unknown (features.19.0.weight)" in refusal(deeper, tmp_path)


def test_another_network_is_told_apart_from_a_damaged_one(state, tmp_path):
    other = {"conv1.weight": torch.zeros(3)}
    assert "not weights of MobileNetV2" in refusal(other, tmp_path)
    assert "not weights of" not in refusal(without(state, "features.0."), tmp_path)


@pytest.mark.parametrize("content", [[1, 2], {"state": 3}, {}, {"state_dict": {"a": 1}}])
def test_what_is_no_state_dict_is_refused(content, tmp_path):
    refusal(content, tmp_path)


class Malicious:
    """Creates a file when unpickled."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self):
        return (Path.touch, (self.file,))


def test_code_in_a_file_is_never_run(tmp_path):
    trace = tmp_path / "trace"
    refusal({"features.0.0.weight": Malicious(trace)}, tmp_path)
    assert not trace.exists()


def test_a_file_that_is_cut_off_is_refused(state, tmp_path):
    file = saved(state, tmp_path)
    file.write_bytes(file.read_bytes()[:100_000])
    with pytest.raises(WeightsError, match=r"^given\.pth: cannot be read .* again\.$"):
        load_weights(empty_network(), file, expected=EXPECTED, device=CPU)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(WeightsError, match=r"absent\.pth: no such file"):
        load_weights(empty_network(), tmp_path / "absent.pth", expected=EXPECTED, device=CPU)


@pytest.fixture
def checkpoints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path / "torch"))
    for variable in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(variable, raising=False)
    return tmp_path / "torch" / "hub" / "checkpoints"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ThreadingHTTPServer]:
    folder = tmp_path / "served"
    folder.mkdir()

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def offer(server: ThreadingHTTPServer, folder: Path, digest: str) -> str:
    name = f"network-{digest[:8]}.pth"
    (folder / "served" / name).write_bytes(CONTENT)
    return f"http://127.0.0.1:{server.server_address[1]}/{name}"


RIGHT = hashlib.sha256(CONTENT).hexdigest()


def test_the_cache_is_where_torch_looks(checkpoints, monkeypatch):
    assert weights_cache.checkpoint_folder() == checkpoints
    assert Path(torch.hub.get_dir()) / "checkpoints" == checkpoints
    monkeypatch.delenv("TORCH_HOME")
    assert Path(torch.hub.get_dir()) / "checkpoints" == weights_cache.checkpoint_folder()


def test_a_download_is_checked_cached_and_reported(checkpoints, server, tmp_path):
    url = offer(server, tmp_path, RIGHT)
    heard: list[tuple[int, int]] = []
    file = weights_cache.cached_or_fetched(url, progress=lambda *step: heard.append(step))
    assert file.parent == checkpoints
    assert file.read_bytes() == CONTENT
    assert heard[-1] == (len(CONTENT), len(CONTENT))
    server.shutdown()
    server.server_close()
    assert weights_cache.cached_or_fetched(url) == file


def test_a_download_that_is_not_the_promised_file_leaves_nothing(checkpoints, server, tmp_path):
    url = offer(server, tmp_path, "0" * 64)
    with pytest.raises(WeightsError, match="SHA-256"):
        weights_cache.cached_or_fetched(url)
    assert list(checkpoints.iterdir()) == []


def test_a_damaged_file_in_the_cache_is_fetched_again(checkpoints, server, tmp_path):
    url = offer(server, tmp_path, RIGHT)
    checkpoints.mkdir(parents=True)
    (checkpoints / weights_cache.file_name(url)).write_bytes(CONTENT[:100])
    assert weights_cache.cached_or_fetched(url).read_bytes() == CONTENT


def test_a_server_without_the_file_is_one_clear_line(checkpoints, server):
    url = f"http://127.0.0.1:{server.server_address[1]}/network-00000000.pth"
    with pytest.raises(WeightsError) as caught:
        weights_cache.cached_or_fetched(url)
    assert str(checkpoints) in str(caught.value)
    assert "not found" in str(caught.value)
    assert "--weights" in str(caught.value)


def test_a_server_that_never_answers_is_given_up(checkpoints, monkeypatch):
    monkeypatch.setattr(weights_cache, "CONNECT_TIMEOUT_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}/network-00000000.pth"
        with pytest.raises(WeightsError, match=r"did not answer within 0\.2 s"):
            weights_cache.cached_or_fetched(url)
    assert not checkpoints.exists()


def test_a_cache_that_may_not_be_read_is_one_clear_line(monkeypatch):
    """As that of root after ``sudo``."""

    def refuse(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refuse)
    with pytest.raises(WeightsError, match=r"Permission denied.*--weights"):
        weights_cache.cached_or_fetched("http://127.0.0.1/network-00000000.pth")
