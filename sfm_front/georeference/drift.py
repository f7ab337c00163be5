"""How exact a fit to positions is whose errors drift."""

from __future__ import annotations

import numpy as np

from sfm_front.types import Float64Array

# Photos are taken together to so many blocks: what happens within them is averaged out.
_MAX_BLOCKS = 32
# How the errors may drift: this share of their variance is common to photos that are near each
# other, up to this share of the whole sequence. Nothing is known of it beforehand.
_SHARES = (0.5, 0.9, 0.99)
_LENGTHS = (0.1, 0.3, 1.0)
# What the claimed standard deviations weigh against the residuals, in observations.
_PRIOR_OBSERVATIONS = 2.0


def drifting_information(
    design: Float64Array, residuals: Float64Array, information: Float64Array, claimed: float
) -> Float64Array:
    """Covariance (P, P) of JᵀWr, the right-hand side of normal equations, where errors drift.

    Were the errors independent and as large as said, it were JᵀWJ. ``design`` (N, 3, P) and
    ``residuals`` (N, 3) in standard deviations, photos in the order in which they were taken;
    ``information`` (P, P): what is known of the parameters beside them; ``claimed``: mean variance
    that the fixes claim, in those units.

    The fit itself swallows most of a slow drift, so residuals alone say too little. Hence errors
    are a Gaussian process, r ~ k² ((1 - s) δ + s exp(-|Δt| / l)), and the result is the mean over
    shares s, lengths l and factors k by their marginal likelihood given the residuals (C. Rasmussen
    & C. Williams, "Gaussian Processes for Machine Learning", 2006, sections 2.7 and 5.4).
    """
    blocks = np.arange(len(design)) * min(len(design), _MAX_BLOCKS) // len(design)
    counts = np.bincount(blocks).astype(np.float64)
    times = np.bincount(blocks, np.arange(len(design))) / counts / len(design)
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    x = np.add.reduceat(design, starts) / counts[:, None, None]
    y = np.add.reduceat(residuals, starts) / counts[:, None]
    correlations = _correlations(times, 1 / counts)
    inverses = np.linalg.inv(correlations)
    # xᵀ R⁻¹ x, xᵀ R⁻¹ y and yᵀ R⁻¹ y for each R of the grid.
    solved = np.einsum("gmn,nap->gmap", inverses, x, optimize=True)
    normal = np.einsum("map,gmaq->gpq", x, solved, optimize=True) + information
    right = np.einsum("gmap,ma->gp", solved, y, optimize=True)
    squares = np.einsum("ma,gmn,na->g", y, inverses, y, optimize=True)
    squares -= np.einsum("gp,gp->g", right, np.linalg.solve(normal, right[..., None])[..., 0])
    squares = np.maximum(squares, 0) + _PRIOR_OBSERVATIONS * claimed
    degrees = _PRIOR_OBSERVATIONS + max(y.size - design.shape[2], 1)
    log_likelihoods = (
        -3 * np.linalg.slogdet(correlations)[1]
        - np.linalg.slogdet(normal)[1]
        - degrees * np.log(squares)
    ) / 2
    likelihoods = np.exp(log_likelihoods - log_likelihoods.max())
    factors = likelihoods / likelihoods.sum() * squares / max(degrees - 2, 1)
    mean = np.einsum("g,gmn->mn", factors, correlations)
    weighted = x * counts[:, None, None]
    spread: Float64Array = np.einsum("map,mn,naq->pq", weighted, mean, weighted, optimize=True)
    return spread


def _correlations(times: Float64Array, white: Float64Array) -> Float64Array:
    """(G, M, M) of errors without drift and with drift of each share and length."""
    apart = np.abs(times[:, None] - times)
    drifts = [np.zeros((len(times), len(times)))]
    shares = [0.0]
    for share in _SHARES:
        for length in _LENGTHS:
            drifts.append(np.exp(-apart / length))
            shares.append(share)
    of_each = np.array(shares)[:, None, None]
    mixed: Float64Array = (1 - of_each) * np.diag(white) + of_each * np.array(drifts)
    return mixed
