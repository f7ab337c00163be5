"""``cluster/`` in an output: what workers have made and the database does not hold yet."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from uuid import uuid4

from sfm_front.cluster.work import GroupWork, GrownModel
from sfm_front.features.feature_cache import FeatureCache
from sfm_front.mapping.model_state import ModelState
from sfm_front.session.output_folder import WORKING_FOLDER
from sfm_front.storage.atomic import write_atomically
from sfm_front.storage.json_files import as_json

_TOKEN = "token"
_STATE = "models.json"


class WorkingFolder:
    """Features by digest, and the models of groups by what they were grown of."""

    def __init__(self, output: Path) -> None:
        self.path = (output / WORKING_FOLDER).resolve()
        self.path.mkdir(exist_ok=True)
        self.features = FeatureCache(self.path)
        self._models = self.path / "models"

    def write_token(self) -> tuple[Path, str]:
        """A small file, and what is in it: who can read it shares this folder."""
        content = uuid4().hex
        write_atomically(self.path / _TOKEN, lambda file: file.write(content.encode()))
        return self.path / _TOKEN, content

    def save_models(self, key: str, models: Sequence[GrownModel]) -> None:
        """Those of a group, whole or not at all."""
        folder = self._models / key
        shutil.rmtree(folder, ignore_errors=True)
        for number, model in enumerate(models):
            for name, content in model.files.items():
                _write(folder / str(number) / Path(name).name, content)
        rows = [
            {
                "state": asdict(model.state),
                "registered": model.num_registered,
                "files": {name: len(content) for name, content in model.files.items()},
            }
            for model in models
        ]
        # Last: without it the others do not count.
        _write(folder / _STATE, as_json(rows).encode())

    def load_models(self, key: str) -> list[GrownModel] | None:
        """None if there are none, or they are damaged."""
        folder = self._models / key
        try:
            rows = json.loads((folder / _STATE).read_text(encoding="utf-8"))
            models = []
            for number, row in enumerate(rows):
                files = {
                    Path(name).name: (folder / str(number) / Path(name).name).read_bytes()
                    for name in row["files"]
                }
                if any(len(content) != row["files"][name] for name, content in files.items()):
                    return None
                models.append(GrownModel(files, ModelState(**row["state"]), row["registered"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return models


def key_of(work: GroupWork) -> str:
    """Equal for groups only if the same photos and matches are in them."""
    digest = hashlib.blake2b(digest_size=16)
    for photo in work.photos:
        digest.update(f"{photo.image_id} {photo.camera_id} {photo.name}\n".encode())
        digest.update(photo.points.tobytes())
        for pair in work.pairs.get(photo.image_id, ()):
            digest.update(f"{pair.image_id2}".encode())
            digest.update(pair.two_view_geometry.inlier_matches.tobytes())
    for camera in work.cameras.values():
        digest.update(str(camera.todict()).encode())
    return digest.hexdigest()


def key_of_join(first: str, second: str) -> str:
    """Of what is joined of two groups with these keys."""
    return hashlib.blake2b(f"{first} and {second}".encode(), digest_size=16).hexdigest()


def _write(path: Path, content: bytes) -> None:
    write_atomically(path, lambda file: file.write(content))
