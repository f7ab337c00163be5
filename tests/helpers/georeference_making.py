"""What a run says of positions, made by hand."""

from __future__ import annotations

import numpy as np
import pycolmap

from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.accuracy import AxisResiduals, Bend, Outlier, ResidualSummary
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import Sidecar, Uncertainty
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.run_summary import GeoreferenceOutcome

RESIDUALS = ResidualSummary(
    num_used=17,
    east=AxisResiduals(0.0, 0.18, 0.18),
    north=AxisResiduals(0.0, 0.35, 0.35),
    up=AxisResiduals(0.0, 0.18, 0.18),
    median_m=0.33,
    ce90_m=0.56,
    le90_m=0.31,
    outliers=(Outlier(7, 201.3),),
    bend=Bend(0.4, 0.004),
)

METRIC = Sidecar(
    state=GeoreferenceState.METRIC,
    origin=LocalFrame(46.84, -91.99, 300.0),
    models_in_enu=(0,),
    enu_from_built=pycolmap.Sim3d(2.0, pycolmap.Rotation3d(np.array([0.1, 0.2, 0.3])), [4, 5, 6]),
    uncertainty=Uncertainty(0.011, 2.4, 0.6, (1.2, 1.2, 2.5)),
    residuals=RESIDUALS,
    names={7: "DJI_7.JPG"},
    flight=FlightFigures(2.1, 55.0, 12_100.0),
)

FLIGHT = GeoreferenceOutcome(sidecar=METRIC, num_unused_rows=3, kept_positions=True)
