"""The models of a session on the earth, as its photos come."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
import pycolmap

from sfm_front.events import Emit, Georeferenced
from sfm_front.geometry.enu import LocalFrame
from sfm_front.geometry.exif_orientation import upright_from_cam
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.flight_figures import flight_figures
from sfm_front.georeference.georeferencer import Georeference, Georeferencer, PhotoPosition
from sfm_front.georeference.sidecar import Sidecar, sidecar_of
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.mapping.model import Model
from sfm_front.mapping.position_priors import PositionPriors
from sfm_front.reports.run_summary import GeoreferenceOutcome
from sfm_front.session.photo_positions import PhotoPositions

# Looked at again once there are more positions by this factor: later ones hardly move the frame.
_GROWTH = 1.05


class Georeferencing:
    """Turns models into a frame of the earth as soon as positions of their photos fix it.

    ``georeference`` is that of the largest model, as it was looked at last.
    """

    def __init__(self, positions: PhotoPositions, emit: Emit, *, seed: int, is_on: bool) -> None:
        self._positions = positions
        self._emit = emit
        self._is_on = is_on
        self._georeferencer = Georeferencer(seed=seed)
        self.georeference = Georeference()
        self._told: tuple[int, GeoreferenceState] | None = None
        # Model id → positions that there were when it was looked at.
        self._looked_at: dict[int, int] = {}
        # Model id → from the frame in which it was built.
        self._enu_from_built: dict[int, pycolmap.Sim3d] = {}
        self._controlled: _Controlled | None = None

    def follow(self, models: Sequence[Model]) -> None:
        """After each photo: look at models that are new, or have been looked at with clearly fewer
        positions."""
        self._look_at_all(models, self._is_due)

    def settle(self, models: Sequence[Model]) -> None:
        """Look at all models, the largest first, and move those whose place is known."""
        self._look_at_all(models, lambda _: True)

    def frame_of(self, models: Sequence[Model]) -> LocalFrame | None:
        """The one in which positions have put some of them; None if they have put none there."""
        is_fixed = any(model.is_georeferenced for model in models)
        return self._georeferencer.frame if is_fixed else None

    def priors_of(self, model: Model) -> PositionPriors | None:
        """The positions to which a finished model is held; None if it is not, as where they
        contradict its photos."""
        if not (model.is_georeferenced and model.is_held_to_positions):
            return None
        measured = self._positions.measured(self._positions.checked().usable)
        found = self._georeferencer.look_at(self._poses(model), measured)
        return found.priors if found.state is GeoreferenceState.METRIC else None

    def held_to_control(
        self, model: Model, frame: LocalFrame, enu_from_model: pycolmap.Sim3d, reason: str
    ) -> None:
        """Control points have moved a finished model by this into the frame. ``reason``: why it is
        metric, in words.

        A frame that no positions have fixed is not kept: the next run, whose control points may be
        others, begins without.
        """
        built = self._from_built(model, enu_from_model)
        if model.is_georeferenced:
            self._enu_from_built[model.model_id] = built
        self._controlled = _Controlled(model.model_id, frame, built, reason)

    def sidecar(
        self,
        models: Sequence[Model],
        control: ControlReport | None = None,
        *,
        is_final: bool = False,
    ) -> Sidecar | None:
        """What ``georeference.json`` says of the largest model as it stands, and of control points;
        None if there are neither these nor positions. ``is_final``: with the figures of the
        flight."""
        if not self._is_on or not (len(self._positions) or control):
            return None
        checked, names = self._positions.checked(), self._positions.names
        left_out = {names[image_id]: reason.value for image_id, reason in checked.left_out.items()}
        if not models:
            return Sidecar(
                state=GeoreferenceState.NONE,
                reasons=("there is no model",),
                left_out=left_out,
                control_points=control,
            )
        largest, held = models[0], self._controlled
        in_enu = [
            number
            for number, model in enumerate(models)
            if model.is_georeferenced or (held and held.model_id == model.model_id)
        ]
        figures = None
        if is_final and 0 in in_enu:
            figures = flight_figures(largest.reconstruction, pycolmap.Sim3d())
        found = sidecar_of(
            self._as_it_stands(largest, self._positions.measured(checked.usable)),
            names,
            left_out,
            enu_from_built=self._enu_from_built.get(largest.model_id),
            models_in_enu=tuple(in_enu),
            flight=figures,
        )
        found = replace(found, control_points=control)
        if held is None or held.model_id != largest.model_id:
            return found
        # The uncertainty that follows from positions is not that of control points, whose
        # residuals say how exact it is.
        return replace(found, enu_from_built=held.enu_from_built, uncertainty=None)

    def outcome(
        self, models: Sequence[Model], control: ControlReport | None = None
    ) -> GeoreferenceOutcome | None:
        """What the report says of finished models; None where nothing is known of positions and
        there are no control points."""
        sidecar = self.sidecar(models, control, is_final=True)
        unused = self._positions.num_unused_rows
        if sidecar is None and not unused:
            return None
        return GeoreferenceOutcome(
            sidecar=sidecar,
            num_unused_rows=unused,
            kept_positions=models[0].is_held_to_positions if models else None,
        )

    def _as_it_stands(self, largest: Model, measured: Mapping[int, PhotoPosition]) -> Georeference:
        """Photos may have left it since it was looked at, or another one is the largest now."""
        held, poses = self._controlled, self._poses(largest)
        if held is not None and held.model_id == largest.model_id:
            return self._georeferencer.compare(poses, measured, held.frame, held.reason)
        found = self._georeferencer.look_at(poses, measured)
        if held is None or found.state is GeoreferenceState.METRIC:
            return found
        return Georeference(
            state=GeoreferenceState.METRIC, frame=held.frame, reasons=(held.reason,)
        )

    def as_json(self) -> dict[str, Any]:
        """What a resumed session needs; read by ``restore``."""
        return {
            "frame": self._georeferencer.as_json(),
            "enu_from_built": {
                str(model_id): [float(s.scale), *s.rotation.quat.tolist(), *s.translation.tolist()]
                for model_id, s in self._enu_from_built.items()
            },
        }

    def restore(self, row: Mapping[str, Any]) -> None:
        """Go on from what ``as_json`` gave."""
        self._georeferencer.restore(row["frame"])
        self._enu_from_built = {
            int(model_id): pycolmap.Sim3d(
                n[0], pycolmap.Rotation3d(np.array(n[1:5])), np.array(n[5:])
            )
            for model_id, n in row["enu_from_built"].items()
        }

    def _is_due(self, model: Model) -> bool:
        before = self._looked_at.get(model.model_id, 0)
        return len(self._positions) >= max(_GROWTH * before, before + 1)

    def _look_at_all(self, models: Sequence[Model], is_due: Callable[[Model], bool]) -> None:
        if not self._is_on or not len(self._positions):
            return
        # One that is being refined in the background: next time.
        due = [n for n, model in enumerate(models) if not model.is_under_way and is_due(model)]
        if not due:
            return
        measured = self._positions.measured(self._positions.checked().usable)
        for number in due:
            self._looked_at[models[number].model_id] = len(self._positions)
            self._look_at(models[number], measured, is_largest=number == 0)

    def _from_built(self, model: Model, enu_from_model: pycolmap.Sim3d) -> pycolmap.Sim3d:
        """From the frame in which the model was built, if this moves it now."""
        before = self._enu_from_built.get(model.model_id)
        return enu_from_model if before is None else enu_from_model * before

    def _poses(self, model: Model) -> dict[int, pycolmap.Rigid3d]:
        """Of its photos as they were held."""
        reconstruction, orientation_of = model.reconstruction, self._positions.orientation_of
        return {
            i: upright_from_cam(orientation_of(i)) * reconstruction.image(i).cam_from_world()
            for i in reconstruction.reg_image_ids()
        }

    def _look_at(
        self, model: Model, measured: Mapping[int, PhotoPosition], *, is_largest: bool
    ) -> None:
        look = self._georeferencer.update if is_largest else self._georeferencer.look_at
        found = look(self._poses(model), measured)
        if found.state is GeoreferenceState.METRIC and found.alignment is not None:
            moved = found.alignment.enu_from_model
            model.georeference(moved, found.priors)
            self._enu_from_built[model.model_id] = self._from_built(model, moved)
            found = found.in_enu
        if is_largest:
            self.georeference = found
            self._tell(model, found)

    def _tell(self, model: Model, found: Georeference) -> None:
        told = model.model_id, found.state
        if told == self._told or (self._told is None and found.alignment is None):
            return
        self._told = told
        alignment = found.alignment
        self._emit(
            Georeferenced(
                model_id=model.model_id,
                state=found.state.value,
                origin=None if found.frame is None else astuple(found.frame),
                num_used=alignment.num_inliers if alignment else 0,
                num_positions=len(found.image_ids),
                scale_sigma=alignment.scale_sigma if alignment else None,
                reasons=found.reasons,
            )
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Controlled:
    """The model that control points hold, in which frame and why."""

    model_id: int
    frame: LocalFrame
    enu_from_built: pycolmap.Sim3d
    reason: str
