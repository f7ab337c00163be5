"""What can be asked for, and what is said where it cannot."""

from __future__ import annotations

import pytest

from sfm_front.cluster import options
from sfm_front.cluster.options import ClusterOptions, check_installed
from sfm_front.errors import ConfigError, DependencyError


def test_addresses() -> None:
    assert ClusterOptions(address="local:3").num_local == 3
    assert ClusterOptions(address="tcp://base:8786").num_local is None
    assert ClusterOptions(address="tls://10.0.0.1:8786").num_local is None


@pytest.mark.parametrize("address", ["", "local", "local:", "local:0", "base:8786", "tcp://base"])
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(ConfigError, match="--cluster"):
        ClusterOptions(address=address)


@pytest.mark.parametrize("wrong", [{"group_size": 9}, {"overlap": 1.5}, {"attempts": 0}])
def test_options_check_themselves(wrong: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        ClusterOptions(address="local:2", **wrong)


def test_without_the_extra_a_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(options, "find_spec", lambda name: None if name == "distributed" else 1)
    with pytest.raises(DependencyError, match=r"needs distributed: pip install 'sfm-front\[cl"):
        check_installed()
