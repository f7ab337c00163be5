"""Sessions over photos rendered through lenses, with several camera models, and their table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sfm_front.evaluation.lenses.rendering import LENSES, PLAIN, render
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.tuning.trials import Trial, describe, run_trial
from sfm_front.photos.cameras import AUTO
from sfm_front.session.options import SessionOptions

MODELS = (AUTO, "SIMPLE_RADIAL", "OPENCV")


@dataclass(frozen=True, slots=True)
class LensTrial:
    """One session: photos through ``lens``, cameras of ``model``."""

    lens: str
    model: str
    trial: Trial


def try_lens(
    scene: BenchmarkScene,
    lens: str,
    models: Sequence[str],
    renders: Path,
    cache: Path,
    options: SessionOptions,
    count: Callable[[], None],
) -> list[LensTrial]:
    """A session per camera model over the photos of a scene through one of ``LENSES``, by name.

    ``renders`` gets the photos, ``cache`` keeps their features. ``count`` is called for each photo
    that is described or taken in. Raises InputError where there is no ground truth.
    """
    rendered = render(scene, LENSES[lens], renders / lens / scene.name)
    described = describe(rendered, cache, options, count)
    done = []
    for model in models:
        tried = replace(options, cameras=replace(options.cameras, model=model))
        done.append(LensTrial(lens, model, run_trial(rendered, described, "name", tried, count)))
    return done


def format_trials(trials: Sequence[LensTrial]) -> str:
    """A row per scene and lens, a column per camera model: pose AUC at 1, 3 and 5° in percent. The
    last has how far ``auto`` is from its own figure without distortion, at 1°."""
    areas = {(one.trial.scene, one.lens, one.model): one.trial.quality.auc for one in trials}
    models = list(dict.fromkeys(one.model for one in trials))
    lines = [f"| scene | lens | {' | '.join(models)} | {AUTO} at 1° against {PLAIN} |"]
    lines.append("|" + " --- |" * (3 + len(models)))
    for scene, lens in dict.fromkeys((one.trial.scene, one.lens) for one in trials):
        cells = [_percent(areas.get((scene, lens, model))) for model in models]
        here, plain = areas.get((scene, lens, AUTO)), areas.get((scene, PLAIN, AUTO))
        apart = f"{100 * (here[0] - plain[0]):+.1f}" if here and plain else ""
        lines.append(f"| {scene} | {lens} | {' | '.join(cells)} | {apart} |")
    return "\n".join(lines)


def _percent(areas: tuple[float, ...] | None) -> str:
    return " / ".join(f"{100 * area:.1f}" for area in areas) if areas else ""
