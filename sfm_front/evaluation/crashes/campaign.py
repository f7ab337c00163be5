"""A scene reconstructed again and again, struck at random moments until it is finished."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.errors import InputError
from sfm_front.evaluation.crashes.faults import Fault
from sfm_front.evaluation.crashes.oracle import acknowledged, violations
from sfm_front.evaluation.crashes.struck_run import Aim, Moment, Outcome, run
from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG, auc, pose_errors
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.storage.colmap_models import find_models, read_model

# Half of what is struck is killed; half of the moments are those that chance would rarely hit.
_FAULTS = (Fault.KILL, Fault.KILL, Fault.KILL, Fault.TERMINATE, Fault.INTERRUPT, Fault.DISK_FULL)
_AIMS = (Aim.NOTHING, Aim.NOTHING, Aim.WRITE, Aim.EXPORT)
_MAX_ROOM_BYTES = 4 * 2**20
# Of pose AUC: what a finished run may lose to the uninterrupted one.
_AUC_TOLERANCE = 0.005
# What the program may end with, by fault.
_STATUSES = {
    Fault.KILL: (-9,),
    Fault.TERMINATE: (0, 1, 143, -15),
    Fault.INTERRUPT: (0, 1, 130, -2),
    Fault.DISK_FULL: (0, 2),
}
_RAW_ERRORS = ("Traceback", "terminate called", "Check failed", "Fatal Python error")


@dataclass(frozen=True)
class Result:
    """Photos registered in the largest model, and pose AUC at 1, 3 and 5 degrees where known."""

    registered: frozenset[str]
    auc: tuple[float, ...]


@dataclass(frozen=True)
class Strike:
    """A run that was struck; ``violations`` of what must hold after it and its predecessors."""

    moment: Moment
    outcome: Outcome
    violations: tuple[str, ...]


@dataclass
class Report:
    """``finished``: reconstructions brought to their end after strikes, with their results."""

    scene: str
    num_photos: int
    wall_seconds: float
    uninterrupted: Result
    strikes: list[Strike] = field(default_factory=list)
    finished: list[Result] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)


def strike_at_random(
    scene: BenchmarkScene,
    command: Sequence[str],
    output: Path,
    num_strikes: int,
    *,
    seed: int,
    note: Callable[[str], None],
) -> Report:
    """Strike ``num_strikes`` runs of ``command``, which reconstructs ``scene`` into ``output``.

    A run struck is followed by the same command, at whose end or at another moment of which it may
    be struck again; a run that comes to its end is compared with one that was not disturbed, and
    the next begins anew. Moments are uniform over the time of the undisturbed run, or
    over half of it in runs that go on. Raises InputError if the undisturbed one fails.
    """
    draw = np.random.default_rng(seed)
    whole = _begin_anew(scene, command, output)
    report = Report(scene.name, scene.num_photos, whole.wall_seconds, read_result(scene, output))
    shutil.rmtree(output)
    disturbed, promised = False, 0
    while len(report.strikes) < num_strikes or disturbed:
        wanted = len(report.strikes) < num_strikes
        # A run that goes on has less to do.
        within_s = whole.wall_seconds / 2 if disturbed else whole.wall_seconds
        moment = _draw_moment(draw, within_s) if wanted else None
        outcome = run(command, output, scene.num_photos, moment)
        found = [
            *violations(output),
            *_run_violations(outcome, moment, promised),
        ]
        promised = len(acknowledged(output))
        if moment is not None and outcome.phase is not None:
            report.strikes.append(Strike(moment, outcome, tuple(found)))
            disturbed = True
            note(_line(report, report.strikes[-1], num_strikes))
            if not found:
                continue
        elif disturbed:
            ended = read_result(scene, output)
            report.finished.append(ended)
            found += compare(ended, report.uninterrupted)
        report.violations += found
        for violation in found:
            note(f"VIOLATION: {violation}")
        # What is damaged once stays so.
        shutil.rmtree(output, ignore_errors=True)
        disturbed, promised = False, 0
    return report


def read_result(scene: BenchmarkScene, output: Path) -> Result:
    """What the models of an output hold, and how accurate they are."""
    models = [read_model(folder) for folder in find_models(output / "sparse")]
    names = [frozenset(model.images[i].name for i in model.reg_image_ids()) for model in models]
    accuracy: tuple[float, ...] = ()
    if scene.truth is not None:
        truth = pycolmap.Reconstruction(scene.truth)
        accuracy = tuple(auc(pose_errors(truth, models, scene.pairs)))
    return Result(max(names, key=len, default=frozenset()), accuracy)


def compare(ended: Result, uninterrupted: Result) -> list[str]:
    """In what a run that was struck is worse than one that was not."""
    found = []
    if lost := uninterrupted.registered - ended.registered:
        found.append(f"not registered after all: {', '.join(sorted(lost))}")
    for threshold, after, before in zip(
        AUC_THRESHOLDS_DEG, ended.auc, uninterrupted.auc, strict=False
    ):
        if after < before - _AUC_TOLERANCE:
            found.append(
                f"pose AUC at {threshold:g} degrees {100 * after:.1f}, undisturbed "
                f"{100 * before:.1f}"
            )
    return found


def _begin_anew(scene: BenchmarkScene, command: Sequence[str], output: Path) -> Outcome:
    outcome = run(command, output, scene.num_photos, None)
    if outcome.status:
        raise InputError(
            f"{scene.name}: cannot be reconstructed undisturbed, exit status {outcome.status}: "
            f"{outcome.printed.strip().splitlines()[-1:]}"
        )
    return outcome


def _draw_moment(draw: np.random.Generator, within_s: float) -> Moment:
    return Moment(
        after_s=float(draw.uniform(0.0, within_s)),
        fault=_FAULTS[draw.integers(len(_FAULTS))],
        aim=_AIMS[draw.integers(len(_AIMS))],
        # Logs are small, models larger, the database is the largest.
        room_bytes=int(_MAX_ROOM_BYTES ** draw.uniform()),
    )


def _run_violations(outcome: Outcome, moment: Moment | None, promised: int) -> list[str]:
    """``promised``: photos that earlier runs had acknowledged."""
    found = []
    expected: Collection[int] = (0,)
    if moment is not None and outcome.phase is not None:
        expected = _STATUSES[moment.fault]
    if outcome.status not in expected:
        found.append(f"exit status {outcome.status}: {outcome.printed.strip()[-500:]}")
    found += [
        f"printed {raw}: {outcome.printed.strip()[-800:]}"
        for raw in _RAW_ERRORS
        if raw in outcome.printed
    ]
    if outcome.num_restored is not None and outcome.num_restored < promised:
        found.append(f"{promised} photos acknowledged, {outcome.num_restored} found on resuming")
    return found


def _line(report: Report, strike: Strike, num_strikes: int) -> str:
    phase = strike.outcome.phase
    return (
        f"{len(report.strikes)}/{num_strikes}  {strike.moment.fault.value} after "
        f"{strike.moment.after_s:.1f} s, {phase.value if phase else 'ended'}: "
        f"status {strike.outcome.status}, {len(strike.violations)} violations"
    )


def format_report(report: Report) -> str:
    """One table: strikes by phase and fault, and what came of them."""
    counts = Counter((s.outcome.phase, s.moment.fault) for s in report.strikes)
    phases = list(dict.fromkeys(s.outcome.phase for s in report.strikes))
    lines = [f"{report.scene:<24}" + "".join(f"{fault.value:>11}" for fault in Fault)]
    for phase in sorted(filter(None, phases), key=lambda p: p.name):
        cells = "".join(f"{counts[phase, fault]:>11}" for fault in Fault)
        lines.append(f"{phase.value:<24}{cells}")
    resumed = sum(bool(s.outcome.num_restored) for s in report.strikes)
    same = sum(not compare(ended, report.uninterrupted) for ended in report.finished)
    lines += [
        f"{len(report.strikes)} strikes, {resumed} of them on runs that went on from photos stored",
        f"{same} of {len(report.finished)} reconstructions ended as the undisturbed one: "
        f"{len(report.uninterrupted.registered)} of {report.num_photos} photos"
        + _accuracies(report),
        f"violations: {len(report.violations)}",
    ]
    return "\n".join([*lines, *(f"  {violation}" for violation in report.violations)])


def _accuracies(report: Report) -> str:
    if not report.uninterrupted.auc or not report.finished:
        return ""
    worst = np.min([ended.auc for ended in report.finished], axis=0)
    there = " / ".join(f"{100 * value:.1f}" for value in report.uninterrupted.auc)
    least = " / ".join(f"{100 * value:.1f}" for value in worst)
    return f", pose AUC {there}, lowest after strikes {least}"
