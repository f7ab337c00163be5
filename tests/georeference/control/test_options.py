import pytest

from sfm_front.errors import ConfigError
from sfm_front.georeference.control.options import ControlOptions


@pytest.mark.parametrize(
    "wrong",
    [
        {"horizontal_sigma_m": 0.0},
        {"vertical_sigma_m": float("inf")},
        {"max_sigmas": float("nan")},
        {"marked_size": (4000,)},
        {"marked_size": (4000, 0)},
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    (name,) = wrong
    with pytest.raises(ConfigError, match=name):
        ControlOptions(**wrong)
