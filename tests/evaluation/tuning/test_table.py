"""The trials of an option's values as text."""

from __future__ import annotations

import pytest

from sfm_front.evaluation.reconstruction.quality import Quality
from sfm_front.evaluation.tuning.constants import make_sweep
from sfm_front.evaluation.tuning.table import format_sweep
from sfm_front.evaluation.tuning.trials import Trial, TrialKey
from sfm_front.session.options import SessionOptions

SWEEP = make_sweep("guided-ratio", ["0.8"], SessionOptions(threads=1))
NOW, OTHER = 0.7, 0.8


def trial(scene, arrangement, registered, auc=None, seconds=1.0):
    quality = Quality(
        registered=registered,
        registered_in_all=registered + 1,
        models=2,
        points=100,
        reprojection_error_px=0.5,
        auc=auc,
        pairs_joined=None,
        mixed=None,
        gps_residual_m=None,
    )
    return Trial(
        scene=scene,
        arrangement=arrangement,
        photos=10,
        quality=quality,
        verified_pairs=20,
        seconds=seconds,
    )


def trials_of(by_value):
    return {
        TrialKey(one.scene, one.arrangement, SWEEP.options[value]): one
        for value, tried in by_value.items()
        for one in tried
    }


@pytest.fixture
def text():
    return format_sweep(
        SWEEP,
        trials_of(
            {
                NOW: [
                    trial("loser", "name", 9, (0.5, 0.7, 0.9)),
                    trial("loser", "half", 8, (0.7, 0.9, 1.0)),
                    trial("same", "name", 5),
                    trial("same", "half", 5),
                ],
                OTHER: [
                    trial("loser", "name", 7, (0.4, 0.7, 0.9), seconds=3.0),
                    trial("loser", "half", 9, (0.6, 0.9, 1.0)),
                    trial("same", "name", 5),
                    trial("same", "half", 5),
                ],
            }
        ),
    )


def test_values_are_summed_over_scenes(text):
    lines = text.splitlines()
    assert lines[0].startswith("guided.max_ratio (guided-ratio)")
    header, now, other = (line.split() for line in lines[1:4])
    # "error px" is two words.
    names = [name for name in header if name != "px"]
    now, other = (dict(zip(names, line, strict=True)) for line in (now, other))
    assert (now["value"], other["value"]) == ("0.7*", "0.8")
    assert (now["name"], now["half"]) == ("14/20", "13/20")
    assert (other["name"], other["half"]) == ("12/20", "14/20")
    assert (now["all"], now["models"]) == ("31", "8")
    assert (now["AUC@1"], other["AUC@1"], other["AUC@5"]) == ("60.00", "50.00", "95.00")
    assert (now["time"], other["time"]) == ("1.00", "1.50")


def test_a_loss_is_marked_and_scenes_that_do_not_differ_are_left_out(text):
    header, now, other = (line.split() for line in text.splitlines()[1:4])
    lost = header.index("lost")
    assert (now[lost], other[lost]) == ("0", "1")
    assert (now[lost + 1], other[lost + 1]) == ("0", "0")  # gained: by its sum, not by one order
    scenes = text.split("\n\n")[1].splitlines()
    assert scenes[0].startswith("scene (name+half)")
    assert len(scenes) == 2
    assert "9+8 AUC 60.0/80.0/95.0" in scenes[1]
    assert "7+9 (-1) AUC 50.0/80.0/95.0" in scenes[1]


def test_values_that_make_no_difference_are_said_so():
    same = trials_of({value: [trial("same", "name", 5)] for value in (NOW, OTHER)})
    assert format_sweep(SWEEP, same).endswith("\nno scene differs in registered photos or AUC")
