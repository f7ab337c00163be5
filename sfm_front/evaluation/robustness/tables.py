"""The robustness benchmarks as tables in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.reconstruction.quality import Quality
from sfm_front.evaluation.robustness.sparse import Comparison
from sfm_front.evaluation.tuning.trials import Trial

_AUC = AUC_THRESHOLDS_DEG.index(3.0)


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
    """A row per arrangement, a column per scene: photos in the largest model; pose AUC at 3 degrees
    in percent, else its distance from GPS; models if they are several. Below the worst and the best
    of each."""
    cells = {
        (trial.arrangement, trial.scene): _cell([trial.quality], max)
        + (f" ({trial.quality.models} models)" if trial.quality.models > 1 else "")
        for trial in trials
    }
    for label, extreme in (("worst", min), ("best", max)):
        for scene in dict.fromkeys(trial.scene for trial in trials):
            qualities = [trial.quality for trial in trials if trial.scene == scene]
            cells[label, scene] = _cell(qualities, extreme)
    return "\n".join(_markdown("order", cells))


def _counts(one: Comparison) -> str:
    """``25: 25 25 **14**``."""
    misses = one.misses()
    ours = (
        f"**{trial.quality.registered}**" if order in misses else str(trial.quality.registered)
        for order, trial in one.ours.items()
    )
    return f"{one.rival.registered}: {' '.join(ours)}"


def _cell(qualities: Sequence[Quality], extreme: Callable[[Iterable[float]], float]) -> str:
    """The worst (min) or the best (max) of each figure: ``11, 96.4`` or ``75, 0.8 m``."""
    text = str(extreme(quality.registered for quality in qualities))
    areas = [quality.auc[_AUC] for quality in qualities if quality.auc is not None]
    metres = [q.gps_residual_m for q in qualities if q.gps_residual_m is not None]
    if areas:
        text += f", {100 * extreme(areas):.1f}"
    elif metres:
        text += f", {-extreme(-value for value in metres):.1f} m"
    return text


def _markdown(corner: str, cells: dict[tuple[str, str], str]) -> list[str]:
    """The lines of a table of cells by row and column."""
    rows = dict.fromkeys(row for row, _ in cells)
    columns = dict.fromkeys(column for _, column in cells)
    lines = [[corner, *columns], ["---"] * (1 + len(columns))]
    lines += [[row, *(cells.get((row, column), "") for column in columns)] for row in rows]
    return [f"| {' | '.join(line)} |" for line in lines]
