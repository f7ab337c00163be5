"""The robustness benchmarks as tables in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.reconstruction.quality import Quality
from sfm_front.evaluation.robustness.sparse import Comparison
from sfm_front.evaluation.tuning.trials import Trial

_AUC_DEG = 3.0


def format_comparisons(comparisons: Sequence[Comparison]) -> str:
    """A row per scene, a column per thinning: photos in the rival's largest model, then in ours by
    order. Fewer than the rival's are bold and counted below; so are models that mix landmarks."""
    cells = {(one.scene, one.thinning): _counts(one) for one in comparisons}
    lines = _markdown("scene", cells)
    missed = sum(len(one.misses()) for one in comparisons)
    runs = sum(len(one.ours) for one in comparisons)
    lines += ["", f"Ours has fewer than COLMAP in {missed} of {runs} runs."]
    for one in comparisons:
        if one.rival.mixed is not None:
            ours = ", ".join(str(trial.quality.mixed) for trial in one.ours.values())
            lines.append(
                f"Models that mix landmarks, {one.scene}, {one.thinning}: "
                f"COLMAP {one.rival.mixed}, ours {ours}."
            )
    return "\n".join(lines)


def format_orders(trials: Sequence[Trial]) -> str:
    """A row per arrangement, a column per scene: photos in the largest model, pose AUC at 3 degrees
    in percent, and models if they are several. The worst and the best of both stand below."""
    cells = {(trial.arrangement, trial.scene): _worth(trial.quality) for trial in trials}
    for label, extreme in (("worst", min), ("best", max)):
        for scene in dict.fromkeys(trial.scene for trial in trials):
            qualities = [trial.quality for trial in trials if trial.scene == scene]
            cells[label, scene] = _extreme(qualities, extreme)
    return "\n".join(_markdown("order", cells))


def _counts(one: Comparison) -> str:
    """``25: 25 25 **14**``."""
    misses = one.misses()
    ours = (
        f"**{trial.quality.registered}**" if order in misses else str(trial.quality.registered)
        for order, trial in one.ours.items()
    )
    return f"{one.rival.registered}: {' '.join(ours)}"


def _worth(quality: Quality) -> str:
    """``11, 96.4`` or ``11, 96.4 (2 models)``."""
    several = f" ({quality.models} models)" if quality.models > 1 else ""
    return _figures(quality.registered, _auc(quality)) + several


def _extreme(qualities: Sequence[Quality], extreme: Callable[[Iterable[float]], float]) -> str:
    areas = [area for area in map(_auc, qualities) if area is not None]
    return _figures(
        extreme(quality.registered for quality in qualities), extreme(areas) if areas else None
    )


def _auc(quality: Quality) -> float | None:
    return None if quality.auc is None else quality.auc[AUC_THRESHOLDS_DEG.index(_AUC_DEG)]


def _figures(registered: float, area: float | None) -> str:
    return f"{registered}" if area is None else f"{registered}, {100 * area:.1f}"


def _markdown(corner: str, cells: dict[tuple[str, str], str]) -> list[str]:
    """The lines of a table of cells by row and column."""
    rows = dict.fromkeys(row for row, _ in cells)
    columns = dict.fromkeys(column for _, column in cells)
    lines = [[corner, *columns], ["---"] * (1 + len(columns))]
    lines += [[row, *(cells.get((row, column), "") for column in columns)] for row in rows]
    return [f"| {' | '.join(line)} |" for line in lines]
