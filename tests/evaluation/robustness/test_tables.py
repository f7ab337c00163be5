"""The robustness benchmarks as text."""

from __future__ import annotations

from dataclasses import replace

from sfm_front.evaluation.reconstruction.quality import Quality
from sfm_front.evaluation.robustness.sparse import ORDERS, Comparison
from sfm_front.evaluation.robustness.tables import format_comparisons, format_orders
from sfm_front.evaluation.tuning.trials import Trial


def quality(registered, *, auc=None, models=1, mixed=None, gps_residual_m=None):
    return Quality(
        registered=registered,
        registered_in_all=registered,
        models=models,
        points=100,
        reprojection_error_px=0.5,
        auc=auc,
        pairs_joined=None,
        mixed=mixed,
        gps_residual_m=gps_residual_m,
    )


def trial(scene, arrangement, worth):
    return Trial(
        scene=scene,
        arrangement=arrangement,
        photos=10,
        quality=worth,
        verified_pairs=20,
        seconds=1.0,
    )


def comparison(scene, thinning, rival, *ours):
    tried = {
        order: trial(scene, f"{thinning}-{order}", quality(registered))
        for order, registered in zip(ORDERS, ours, strict=True)
    }
    return Comparison(scene=scene, thinning=thinning, photos=10, rival=quality(rival), ours=tried)


def test_misses_are_marked_and_counted():
    text = format_comparisons(
        [
            comparison("sparse", "whole", 10, 10, 9, 11),
            comparison("sparse", "third", 4, 3, 3, 4),
            comparison("dense", "third", 8, 8, 8, 8),
        ]
    )
    assert text.splitlines() == [
        "| scene | whole | third |",
        "| --- | --- | --- |",
        "| sparse | 10: 10 **9** 11 | 4: **3** **3** 4 |",
        "| dense |  | 8: 8 8 8 |",
        "",
        "Ours has fewer than COLMAP in 3 of 9 runs.",
    ]


def test_mixed_landmarks_are_told_where_they_are_known():
    one = comparison("town", "half", 8, 8, 8, 8)
    known = {
        order: trial("town", order, quality(8, mixed=number)) for number, order in enumerate(ORDERS)
    }
    text = format_comparisons([one, replace(one, rival=quality(8, mixed=2), ours=known)])
    assert text.splitlines()[-1] == "Models that mix landmarks, town, half: COLMAP 2, ours 0, 1, 2."
    assert text.count("landmarks") == 1


def test_orders_have_their_worst_and_best():
    text = format_orders(
        [
            trial("door", "shuffle-1", quality(12, auc=(0.5, 0.9, 1.0))),
            trial("door", "shuffle-2", quality(9, auc=(0.6, 0.954, 1.0), models=2)),
            trial("dunes", "shuffle-1", quality(38, gps_residual_m=0.8)),
            trial("dunes", "shuffle-2", quality(41, gps_residual_m=12.04)),
            trial("toys", "shuffle-1", quality(5)),
        ]
    )
    assert text.splitlines() == [
        "| order | door | dunes | toys |",
        "| --- | --- | --- | --- |",
        "| shuffle-1 | 12, 90.0 | 38, 0.8 m | 5 |",
        "| shuffle-2 | 9, 95.4 (2 models) | 41, 12.0 m |  |",
        "| worst | 9, 90.0 | 38, 12.0 m | 5 |",
        "| best | 12, 95.4 | 41, 0.8 m | 5 |",
    ]
