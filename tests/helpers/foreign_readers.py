"""Readers of exported folders that follow the targets' own documents, and nothing of ours.

Each gives a list of ``ReadPhoto``: how the target would project points into the photo, and where
the export says that points are seen.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class ReadPhoto:
    """``seen``: (3,) points and the (2,) pixels that show them, from the photo's upper left corner,
    y down; a photo may show a point twice."""

    file: Path
    project: Callable[[np.ndarray], np.ndarray]
    size: tuple[int, int] | None = None
    seen: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)

    def errors_px(self) -> np.ndarray:
        """(N, 2) where points project minus where they are seen."""
        points, pixels = (np.array(values) for values in zip(*self.seen, strict=True))
        return self.project(points) - pixels


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """(w, x, y, z), by Rodrigues' formula."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def _pinhole(rotation, translation, fx, fy, cx, cy):
    def project(points: np.ndarray) -> np.ndarray:
        x, y, z = (points @ rotation.T + translation).T
        return np.column_stack([fx * x / z + cx, fy * y / z + cy])

    return project


# --- COLMAP's binary form, as Inria's colmap_loader.py takes it: bytes of names one by one -------


def read_splat_scene(folder: Path, *, centred: bool) -> list[ReadPhoto]:
    """``sparse/0`` by struct; with ``centred``, the principal point is taken to be the middle."""
    sparse = folder / "sparse" / "0"
    cameras = {}
    with (sparse / "cameras.bin").open("rb") as file:
        (count,) = _unpack(file, "Q")
        for _ in range(count):
            camera_id, model, width, height = _unpack(file, "iiQQ")
            assert model == 1, "not PINHOLE"
            cameras[camera_id] = (width, height, *_unpack(file, "dddd"))
    points = _read_points(sparse / "points3D.bin")
    photos = []
    with (sparse / "images.bin").open("rb") as file:
        (count,) = _unpack(file, "Q")
        for _ in range(count):
            _, *pose, camera_id = _unpack(file, "idddddddi")
            name = ""
            while (byte := file.read(1)) != b"\0":
                name += byte.decode("ascii")
            width, height, fx, fy, cx, cy = cameras[camera_id]
            if centred:
                cx, cy = width / 2, height / 2
            project = _pinhole(rotation_of(pose[:4]), np.array(pose[4:]), fx, fy, cx, cy)
            photo = ReadPhoto(folder / "images" / name, project, (width, height))
            (num,) = _unpack(file, "Q")
            values = _unpack(file, "ddq" * num)
            for x, y, point in zip(values[::3], values[1::3], values[2::3], strict=True):
                if point != -1:
                    photo.seen.append((points[point], np.array([x, y])))
            photos.append(photo)
    return photos


def _read_points(file: Path) -> dict[int, np.ndarray]:
    points = {}
    with file.open("rb") as stream:
        (count,) = _unpack(stream, "Q")
        for _ in range(count):
            point, *xyz = _unpack(stream, "QdddBBBd")[:4]
            (length,) = _unpack(stream, "Q")
            stream.read(8 * length)
            points[point] = np.array(xyz)
    return points


def _unpack(file, kinds: str):
    return struct.unpack(f"<{kinds}", file.read(struct.calcsize(f"<{kinds}")))


# --- COLMAP's text, as InterfaceCOLMAP.cpp takes it ----------------------------------------------


def read_openmvs_scene(folder: Path) -> list[ReadPhoto]:
    """``sparse/*.txt``; reading cameras ends at the first that is not PINHOLE."""
    cameras = {}
    for line in _lines(folder / "sparse" / "cameras.txt"):
        camera_id, model, width, height, *params = line.split()
        if model != "PINHOLE":
            break
        cameras[int(camera_id)] = (int(width), int(height), *map(float, params))
    points = {}
    for line in _lines(folder / "sparse" / "points3D.txt"):
        words = line.split()
        assert len(words) > 8, "a point without a track ends the reading"
        points[int(words[0])] = np.array(words[1:4], float)
    lines = _lines(folder / "sparse" / "images.txt")
    photos = []
    for line in lines:
        words = line.split(" ")
        pose, camera_id, name = np.array(words[1:8], float), int(words[8]), words[9]
        width, height, fx, fy, cx, cy = cameras[camera_id]
        project = _pinhole(rotation_of(pose[:4]), pose[4:], fx, fy, cx, cy)
        photo = ReadPhoto(folder / "images" / name, project, (width, height))
        values = np.array(next(lines).split(), float).reshape(-1, 3)
        for x, y, point in values:
            if point != -1:
                photo.seen.append((points[int(point)], np.array([x, y])))
        photos.append(photo)
    return photos


def _lines(file: Path) -> Iterator[str]:
    return (line for line in file.read_text("utf-8").splitlines() if not line.startswith("#"))


# --- Bundler v0.3 --------------------------------------------------------------------------------


def read_bundler_scene(folder: Path) -> list[ReadPhoto]:
    """By the manual of Bundler v0.4; pixels turned from its middle-and-up into corner-and-down."""
    from PIL import Image

    header, *rest = (folder / "bundle.out").read_text("ascii").splitlines()
    assert header == "# Bundle file v0.3"
    numbers = iter([float(word) for line in rest for word in line.split()])
    num_cameras, num_points = int(next(numbers)), int(next(numbers))
    names = [line.split()[0] for line in (folder / "list.txt").read_text("utf-8").splitlines()]
    assert len(names) == num_cameras
    photos = []
    for name in names:
        focal, k1, k2 = _take(numbers, 3)
        rotation, translation = _take(numbers, 9).reshape(3, 3), _take(numbers, 3)
        file = folder / name
        size = Image.open(file).size
        photos.append(
            ReadPhoto(file, _bundler_camera(rotation, translation, focal, k1, k2, size), size)
        )
    for _ in range(num_points):
        point = _take(numbers, 3)
        _take(numbers, 3)
        for _ in range(int(next(numbers))):
            camera, _, x, y = _take(numbers, 4)
            photo = photos[int(camera)]
            photo.seen.append((point, np.array([photo.size[0] / 2 + x, photo.size[1] / 2 - y])))
    assert next(numbers, None) is None
    return photos


def _bundler_camera(rotation, translation, focal, k1, k2, size):
    def project(points: np.ndarray) -> np.ndarray:
        there = points @ rotation.T + translation
        flat = -there[:, :2] / there[:, 2:]
        square = np.sum(flat**2, axis=1, keepdims=True)
        up = focal * (1 + k1 * square + k2 * square**2) * flat
        return np.column_stack([size[0] / 2 + up[:, 0], size[1] / 2 - up[:, 1]])

    return project


def _take(numbers: Iterator[float], count: int) -> np.ndarray:
    return np.array([next(numbers) for _ in range(count)])


# --- VisualSFM's NVM_V3 --------------------------------------------------------------------------


def read_nvm_scene(folder: Path) -> list[ReadPhoto]:
    """By ccwu.me/vsfm/doc.html. ``seen`` is undistorted, as r undistorts measurements; ``project``
    is a pinhole."""
    words = iter((folder / "model.nvm").read_text("utf-8").split())
    assert next(words) == "NVM_V3"
    cameras = []
    for _ in range(int(next(words))):
        name = next(words)
        focal, *rest = (float(next(words)) for _ in range(10))
        rotation, centre = rotation_of(np.array(rest[:4])), np.array(rest[4:7])
        project = _pinhole(rotation, -rotation @ centre, focal, focal, 0, 0)
        assert rest[8] == 0
        cameras.append((ReadPhoto(folder / name, project), focal, rest[7]))
    for _ in range(int(next(words))):
        point = np.array([float(next(words)) for _ in range(3)])
        assert all(0 <= int(next(words)) < 256 for _ in range(3))
        for _ in range(int(next(words))):
            photo, focal, radial = cameras[int(next(words))]
            next(words)
            measured = np.array([float(next(words)), float(next(words))])
            straight = measured * (1 + radial * measured @ measured / focal**2)
            photo.seen.append((point, straight))
    assert next(words) == "0"  # no second model
    return [photo for photo, _, _ in cameras]


# --- nerfstudio ----------------------------------------------------------------------------------


def read_nerfstudio_scene(folder: Path) -> list[ReadPhoto]:
    """By docs.nerf.studio/quickstart/data_conventions.html, with OpenCV's lenses."""
    content = json.loads((folder / "transforms.json").read_text("utf-8"))
    photos = []
    for frame in content["frames"]:
        known = {**content, **frame}
        world_from_camera = np.array(known["transform_matrix"])
        lens = {"OPENCV": _brown, "OPENCV_FISHEYE": _kannala, "PINHOLE": _brown}
        photos.append(
            ReadPhoto(
                folder / known["file_path"],
                _opengl_camera(world_from_camera, known, lens[content["camera_model"]]),
                (known["w"], known["h"]),
            )
        )
    return photos


def _opengl_camera(world_from_camera, known, distort):
    def project(points: np.ndarray) -> np.ndarray:
        homogeneous = np.column_stack([points, np.ones(len(points))])
        right, up, back, _ = np.linalg.solve(world_from_camera, homogeneous.T)
        x, y = distort(right / -back, up / back, known)
        return np.column_stack([known["fl_x"] * x + known["cx"], known["fl_y"] * y + known["cy"]])

    return project


def _brown(x, y, known):
    k1, k2, p1, p2 = (known.get(name, 0.0) for name in ("k1", "k2", "p1", "p2"))
    square = x**2 + y**2
    radial = 1 + k1 * square + k2 * square**2
    return (
        x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2),
        y * radial + p1 * (square + 2 * y**2) + 2 * p2 * x * y,
    )


def _kannala(x, y, known):
    radius = np.hypot(x, y)
    theta = np.arctan(radius)
    bent = theta * (1 + sum(known[f"k{n}"] * theta ** (2 * n) for n in (1, 2, 3, 4)))
    return x * bent / radius, y * bent / radius
