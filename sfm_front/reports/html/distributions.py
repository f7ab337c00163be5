"""Histograms of a model: how many photos see a point, and how exactly."""

from __future__ import annotations

import numpy as np

from sfm_front.reports.html.charts import histogram, nice_step
from sfm_front.reports.html.markup import Html, figure
from sfm_front.reports.html.observations import Observations

_LONGEST = 20
_ERROR_BINS = 40


def track_lengths(observations: Observations) -> Html:
    """Points by the number of photos that see them."""
    lengths = observations.track_lengths
    longest = int(np.clip(lengths.max(), 5, _LONGEST))
    clipped = np.minimum(lengths, longest)
    counts = np.bincount(clipped, minlength=longest + 1)[2:]
    edges = np.arange(2, longest + 2) - 0.5
    step = 1 if longest <= 12 else 2
    labels = [
        (n, f"{n}+" if n == longest < lengths.max() else str(n)) for n in range(2, longest + 1)
    ]
    mean = float(lengths.mean())
    drawing = histogram(
        counts.tolist(),
        edges.tolist(),
        title="track lengths",
        xlabel="photos that see a point",
        ticks=labels[::-step][::-1],
        mark=(min(mean, longest), f"mean {mean:.1f}"),
    )
    three = float((lengths >= 3).mean())
    return figure(drawing, f"Track length: {three:.0%} of the points are seen by three or more.")


def reprojection_errors(observations: Observations) -> Html:
    """Observations by how far the keypoint is from where its point projects."""
    errors = np.linalg.norm(observations.residuals_px, axis=1)
    errors = errors[np.isfinite(errors)]
    high = max(float(np.percentile(errors, 99.5)), 1e-3)
    step = nice_step(high, 4)
    high = step * np.ceil(high / step)
    counts, edges = np.histogram(np.minimum(errors, high), _ERROR_BINS, (0, high))
    ticks = [(float(at), f"{at:g}") for at in np.round(np.arange(0, high + step / 2, step), 6)]
    median = float(np.median(errors))
    drawing = histogram(
        counts.tolist(),
        edges.tolist(),
        title="reprojection errors",
        xlabel="pixels of the file",
        ticks=ticks,
        mark=(median, f"median {median:.2f} px"),
    )
    rms = float(np.sqrt(np.mean(errors**2)))
    return figure(drawing, f"Reprojection error of {len(errors)} observations, RMS {rms:.2f} px.")
