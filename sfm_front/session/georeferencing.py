"""The models of a session on the earth, as its photos come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
import pycolmap

from sfm_front.events import Emit, Georeferenced
from sfm_front.geometry.enu import LocalFrame
from sfm_front.geometry.exif_orientation import upright_from_cam
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.georeferencer import Georeference, Georeferencer, PhotoPosition
from sfm_front.georeference.sidecar import Sidecar, sidecar_of
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.mapping.model import Model
from sfm_front.session.photo_positions import PhotoPositions

# Looked at again once there are more positions by this factor: later ones hardly move the frame.
_GROWTH = 1.05


class Georeferencing:
    """Turns models into a frame of the earth as soon as positions of their photos fix it.

    ``georeference`` is that of the largest model.
    """

    def __init__(self, positions: PhotoPositions, emit: Emit, *, seed: int, is_on: bool) -> None:
        self._positions = positions
        self._emit = emit
        self._is_on = is_on
        self._georeferencer = Georeferencer(seed=seed)
        self.georeference = Georeference(reasons=("no photo has a position",))
        self._told: tuple[int, GeoreferenceState] | None = None
        self._num_looked_at = 0
        # Model id → from the frame in which it was built.
        self._enu_from_built: dict[int, pycolmap.Sim3d] = {}
        self._controlled: _Controlled | None = None

    def follow(self, models: Sequence[Model]) -> None:
        """After each photo: look at the models if there are clearly more positions than before."""
        if len(self._positions) >= max(_GROWTH * self._num_looked_at, self._num_looked_at + 1):
            self.settle(models)

    def settle(self, models: Sequence[Model]) -> None:
        """Look at all models, the largest first, and move those whose place is known."""
        if not self._is_on or not len(self._positions):
            return
        self._num_looked_at = len(self._positions)
        measured = self._positions.measured(self._positions.checked().usable)
        for number, model in enumerate(models):
            if not model.is_under_way:  # else next time
                self._look_at(model, measured, is_largest=number == 0)

    def frame_of(self, models: Sequence[Model]) -> LocalFrame | None:
        """The one in which positions have put some of them; None if they have put none there."""
        is_fixed = any(model.is_georeferenced for model in models)
        return self._georeferencer.frame if is_fixed else None

    def held_to_control(
        self,
        models: Sequence[Model],
        number: int,
        frame: LocalFrame,
        enu_from_model: pycolmap.Sim3d,
        reason: str,
    ) -> None:
        """Control points have moved a finished model by this into the frame: what positions say of
        it is compared anew. ``reason``: why it is metric, in words.

        Where no positions fixed the frame, that is not kept: the next run, whose control points may
        be others, begins without.
        """
        model = models[number]
        before = self._enu_from_built.get(model.model_id)
        built = enu_from_model if before is None else enu_from_model * before
        if model.is_georeferenced:
            self._enu_from_built[model.model_id] = built
        self._controlled = _Controlled(model.model_id, built)
        if number == 0:
            measured = self._positions.measured(self._positions.checked().usable)
            poses = self._upright_poses(model)
            self.georeference = self._georeferencer.compare(poses, measured, frame, reason)
        elif self.georeference.state is not GeoreferenceState.METRIC:
            self.georeference = Georeference(
                state=GeoreferenceState.METRIC, frame=frame, reasons=(reason,)
            )

    def sidecar(
        self, models: Sequence[Model], control: ControlReport | None = None
    ) -> Sidecar | None:
        """What ``georeference.json`` says of the largest model as ``settle`` has left it, and of
        control points; None if there are neither these nor positions."""
        if not self._is_on or not (len(self._positions) or control):
            return None
        found, held = self._by_positions(models), self._controlled
        if control is None:
            return found
        found = replace(found, control_points=control)
        if held is None:
            return found
        in_enu = (
            number
            for number, model in enumerate(models)
            if model.is_georeferenced or model.model_id == held.model_id
        )
        found = replace(found, models_in_enu=tuple(in_enu))
        if models[0].model_id != held.model_id:
            return found
        # The uncertainty that follows from positions is not that of control points, whose
        # residuals say how exact it is.
        return replace(found, enu_from_built=held.enu_from_built, uncertainty=None)

    def _by_positions(self, models: Sequence[Model]) -> Sidecar:
        if not models:
            return Sidecar(state=GeoreferenceState.NONE, reasons=("there is no model",))
        names = self._positions.names
        left_out = self._positions.checked().left_out
        return sidecar_of(
            self.georeference,
            _cam_from_world(models[0]),
            names,
            {names[image_id]: reason.value for image_id, reason in left_out.items()},
            enu_from_built=self._enu_from_built.get(models[0].model_id),
            models_in_enu=tuple(n for n, model in enumerate(models) if model.is_georeferenced),
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

    def _look_at(
        self, model: Model, measured: Mapping[int, PhotoPosition], *, is_largest: bool
    ) -> None:
        look = self._georeferencer.update if is_largest else self._georeferencer.look_at
        poses = self._upright_poses(model)
        found = look(poses, measured)
        if found.state is GeoreferenceState.METRIC and found.alignment is not None:
            moved = found.alignment.enu_from_model
            model.georeference(moved, found.priors)
            before = self._enu_from_built.get(model.model_id)
            self._enu_from_built[model.model_id] = moved if before is None else moved * before
            # Of the model as it stands now.
            found = look({i: moved.transform_camera_world(p) for i, p in poses.items()}, measured)
        if is_largest:
            self.georeference = found
            self._tell(model, found)

    def _upright_poses(self, model: Model) -> dict[int, pycolmap.Rigid3d]:
        return {
            image_id: upright_from_cam(self._positions.orientation_of(image_id)) * cam_from_world
            for image_id, cam_from_world in _cam_from_world(model).items()
        }

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
    """The model that control points hold."""

    model_id: int
    enu_from_built: pycolmap.Sim3d


def _cam_from_world(model: Model) -> dict[int, pycolmap.Rigid3d]:
    reconstruction = model.reconstruction
    return {i: reconstruction.image(i).cam_from_world() for i in reconstruction.reg_image_ids()}
