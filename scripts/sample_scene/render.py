"""Photograph a mesh: exact rays from the camera model, sun with shadows, light from the sky."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d as o3d
import pycolmap

from .materials import Surface, reflectance
from .mesh import Material, Mesh
from .noise import Floats, value_noise

# A pixel's rays pass through a rotated square, which smooths edges of any direction.
_SAMPLES = np.array([(0.125, 0.625), (0.375, 0.125), (0.625, 0.875), (0.875, 0.375)])
_SUN = np.array([-0.52, -0.42, 0.74]) / np.linalg.norm([-0.52, -0.42, 0.74])
_SUN_COLOUR = np.array([2.75, 2.5, 2.1])
_SKY_COLOUR = np.array([0.48, 0.60, 0.80])
_HORIZON_COLOUR = 1.5 * np.array([0.52, 0.60, 0.72])
_BOUNCE_COLOUR = np.array([0.16, 0.13, 0.09])
_SUN_SOFTNESS_RAD = 0.004
_HAZE_M = 1200.0
_AMBIENT_RAYS = 24
_AMBIENT_REACH_M = 7.0
_LIFT_M = 0.02  # metres above a surface at which rays from it start
_BLOCK = 1 << 19


@dataclass(frozen=True, eq=False)
class Stage:
    """A mesh that is ready to be rendered."""

    mesh: Mesh
    caster: o3d.t.geometry.RaycastingScene
    openness: Floats  # (V,) fraction of the sky visible from a vertex


def prepare(mesh: Mesh, seed: int) -> Stage:
    """Build the ray-casting structure and compute each vertex's visible fraction of the sky."""
    caster = o3d.t.geometry.RaycastingScene()
    caster.add_triangles(
        o3d.core.Tensor.from_numpy(mesh.vertices), o3d.core.Tensor.from_numpy(mesh.triangles)
    )
    rng = np.random.default_rng(seed)
    seen = np.zeros(len(mesh.vertices), dtype=np.float32)
    start = mesh.vertices + _LIFT_M * mesh.normals
    for _ in range(_AMBIENT_RAYS):
        # A unit vector added to the normal gives directions with a density of cos(angle).
        direction = _normalised(rng.normal(0.0, 1.0, (len(start), 3))) + mesh.normals
        seen += _reaches(caster, start, direction, _AMBIENT_REACH_M)
    return Stage(mesh, caster, seen / _AMBIENT_RAYS)


def camera_rays(camera: pycolmap.Camera) -> Floats:
    """Directions (H * W * 4, 3) in camera coordinates with z = 1; a pixel's rays are adjacent."""
    column, row = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    # COLMAP's pixel (0, 0) covers [0, 1) in x and y, so its centre is at (0.5, 0.5).
    corners = np.stack([column, row], axis=-1)[:, :, None, :]
    normalised = np.asarray(camera.cam_from_img((corners + _SAMPLES).reshape(-1, 2)))
    return np.column_stack([normalised, np.ones(len(normalised))]).astype(np.float32)


def photograph(
    stage: Stage, camera: pycolmap.Camera, rays: Floats, cam_from_world: pycolmap.Rigid3d, seed: int
) -> Floats:
    """A photo (H, W, 3) float32 in [0, 1], gamma applied, before the sensor's noise."""
    rng = np.random.default_rng(seed)
    pose = cam_from_world.matrix()
    centre = (-pose[:, :3].T @ pose[:, 3]).astype(np.float32)
    light = np.empty((len(rays), 3), dtype=np.float32)
    for start in range(0, len(rays), _BLOCK):
        directions = rays[start : start + _BLOCK] @ pose[:, :3].astype(np.float32)
        light[start : start + _BLOCK] = _trace(
            stage, centre, directions, 1.0 / camera.focal_length, rng
        )
    pixels = light.reshape(camera.height, camera.width, len(_SAMPLES), 3).mean(axis=2)
    return _develop(pixels)


def _trace(
    stage: Stage, centre: Floats, directions: Floats, pixel_rad: float, rng: np.random.Generator
) -> Floats:
    """Linear light (N, 3) along rays from ``centre``."""
    mesh = stage.mesh
    origins = np.broadcast_to(centre, directions.shape)
    hits = stage.caster.cast_rays(o3d.core.Tensor.from_numpy(np.hstack([origins, directions])))
    depth = hits["t_hit"].numpy()
    hit = np.isfinite(depth)
    light = np.broadcast_to(_HORIZON_COLOUR, directions.shape).astype(np.float32)
    depth, directions = depth[hit], directions[hit]
    triangle = hits["primitive_ids"].numpy()[hit]
    second = hits["primitive_uvs"].numpy()[hit]
    corners = mesh.triangles[triangle]
    weights = np.column_stack([1.0 - second.sum(axis=1), second]).astype(np.float32)
    normal = _normalised((mesh.normals[corners] * weights[:, :, None]).sum(axis=1))
    openness = (stage.openness[corners] * weights).sum(axis=1)
    xyz = centre + depth[:, None] * directions
    distance = depth * np.linalg.norm(directions, axis=1)
    owner = mesh.owner[triangle]
    material = mesh.material[triangle]
    colour = np.empty_like(xyz)
    for kind in np.unique(material):
        chosen = material == kind
        surface = Surface(
            xyz=xyz[chosen],
            normal=normal[chosen],
            owner=owner[chosen],
            origin=mesh.origins[owner[chosen]],
            radius=mesh.radii[owner[chosen]],
            footprint=distance[chosen] * np.float32(pixel_rad),
        )
        colour[chosen] = reflectance(Material(kind), surface)
    normal = _roughened(xyz, normal, material)
    sun = _normalised(_SUN + _SUN_SOFTNESS_RAD * rng.normal(size=xyz.shape))
    facing = np.clip((normal * sun).sum(axis=1), 0.0, 1.0)
    lit = facing * _reaches(stage.caster, xyz + _LIFT_M * normal, sun, np.inf)
    upward = (0.5 + 0.5 * normal[:, 2])[:, None]
    ambient = upward * _SKY_COLOUR + (1.0 - upward) * _BOUNCE_COLOUR
    shaded = colour * (lit[:, None] * _SUN_COLOUR + (openness**1.3)[:, None] * ambient)
    haze = 1.0 - np.exp(-distance / _HAZE_M)[:, None]
    light[hit] = shaded * (1.0 - haze) + haze * _HORIZON_COLOUR
    return light


def _roughened(xyz: Floats, normal: Floats, material: Floats) -> Floats:
    """Normals with noise on leaves and rocks, which reflect unevenly."""
    normal = normal.copy()
    for kind, strength, cell in ((Material.LEAVES, 0.8, 0.45), (Material.ROCK, 0.45, 0.6)):
        chosen = material == kind
        points = xyz[chosen] / np.float32(cell)
        bump = np.stack([value_noise(points, 200 + axis) for axis in range(3)], axis=1)
        normal[chosen] = _normalised(normal[chosen] + np.float32(strength) * bump)
    return normal


def _reaches(
    caster: o3d.t.geometry.RaycastingScene, start: Floats, direction: Floats, reach: float
) -> Floats:
    """1 for rays that hit nothing within ``reach`` metres, else 0."""
    rays = np.hstack([start, _normalised(direction)]).astype(np.float32)
    blocked = caster.test_occlusions(o3d.core.Tensor.from_numpy(rays), tnear=0.0, tfar=reach)
    free: Floats = 1.0 - blocked.numpy().astype(np.float32)
    return free


def _develop(light: Floats) -> Floats:
    """Linear light → what a camera stores: a soft shoulder, then gamma."""
    exposed = 0.62 * light
    # K. Narkowicz's fit to the ACES film curve.
    toned = exposed * (2.51 * exposed + 0.03) / (exposed * (2.43 * exposed + 0.59) + 0.14)
    grey = toned.mean(axis=2, keepdims=True)
    encoded: Floats = np.clip(0.86 * toned + 0.14 * grey, 0.0, 1.0) ** (1 / 2.2)
    return encoded


def _normalised(vectors: Floats) -> Floats:
    length = np.sqrt(np.einsum("nd,nd->n", vectors, vectors))
    unit: Floats = (vectors / np.maximum(length, 1e-9)[:, None]).astype(np.float32)
    return unit
