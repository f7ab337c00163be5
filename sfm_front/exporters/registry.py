"""Export a model by the name of what it is for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.errors import InputError
from sfm_front.exporters.options import ExportOptions
from sfm_front.exporters.whole_folder import check_vacant, whole_folder

if TYPE_CHECKING:
    from sfm_front.exporters.scene import Job

README = "README.txt"


@dataclass(frozen=True, slots=True)
class Target:
    """``module``: of ``exporters/``, with ``write(job)``, which returns what the user should know.

    ``next_step``: what to do with the folder, which ``{folder}`` stands for.
    """

    module: str
    summary: str
    next_step: str


TARGETS = {
    "colmap-text": Target(
        "colmap_text",
        "COLMAP's text files",
        "colmap gui --import_path {folder} --database_path DATABASE --image_path PHOTOS",
    ),
    "ply": Target("ply", "coloured points", "meshlab {folder}/points3D.ply"),
    "nerfstudio": Target(
        "nerfstudio", "transforms.json, photos, points", "ns-train splatfacto --data {folder}"
    ),
    "3dgs": Target(
        "gaussian_splatting",
        "3D Gaussian splatting (Inria): undistorted, centred photos and a COLMAP model",
        "python train.py -s {folder}",
    ),
    "gsplat": Target(
        "gsplat",
        "gsplat's examples: undistorted photos and a COLMAP model",
        "python examples/simple_trainer.py default --data_dir {folder} --data_factor 1 "
        "--result_dir RESULTS",
    ),
    "openmvs": Target(
        "openmvs",
        "OpenMVS: undistorted photos and a COLMAP model as text",
        "InterfaceCOLMAP -i {folder} -o {folder}/scene.mvs",
    ),
    "bundler": Target(
        "bundler",
        "Bundler v0.3: bundle.out, list.txt, photos",
        "cd {folder} && Bundle2PMVS list.txt bundle.out",
    ),
    "nvm": Target(
        "nvm",
        "VisualSFM's NVM_V3, photos",
        "in VisualSFM: SfM > Load NView Match > {folder}/model.nvm",
    ),
    "geojson": Target(
        "geojson", "camera positions on a map, if georeferenced", "qgis {folder}/cameras.geojson"
    ),
    "csv": Target("csv_table", "camera positions as a table", "libreoffice {folder}/cameras.csv"),
}
"""By the names of the command line."""


@dataclass(frozen=True, slots=True)
class Exported:
    """``folder`` holds ``num_photos`` photos' poses and ``num_points`` points; ``notes`` is what
    the user should know, ``next_step`` what to do now."""

    folder: Path
    num_photos: int
    num_points: int
    notes: tuple[str, ...]
    next_step: str


def export(
    source: Path,
    target: str,
    *,
    output: Path | None = None,
    number: int | None = None,
    images: Path | None = None,
    options: ExportOptions | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Exported:
    """Export a model to ``output``, by default ``export/TARGET`` in the output it belongs to.

    ``source``: a session's output, of which ``number`` picks a model, by default the largest; or
    one COLMAP model. ``images``: where the photos are, if they are no longer where the session
    found them. ``on_progress`` hears how many photos are made, of how many. Whatever ``output``
    held stays, and what this writes is there whole or not at all.

    Raises InputError for a model that is not there, photos that cannot be found, or what the target
    cannot hold, and StorageError if the disk is full.
    """
    from sfm_front.exporters.scene import Job, output_of, read_scene

    if target not in TARGETS:
        raise InputError(f"no target is called {target!r}; there are: {', '.join(TARGETS)}")
    how = TARGETS[target]
    folder = output if output is not None else output_of(source) / "export" / target
    check_vacant(folder)
    scene = read_scene(source, number=number, images=images)
    write: Callable[[Job], list[str]] = import_module(f"sfm_front.exporters.{how.module}").write
    with whole_folder(folder) as fresh:
        notes = tuple(write(Job(scene, fresh, options or ExportOptions(), on_progress)))
        exported = Exported(
            folder=folder,
            num_photos=int(scene.model.num_reg_images()),
            num_points=int(scene.model.num_points3D()),
            notes=notes,
            next_step=how.next_step,
        )
        (fresh / README).write_text(_readme(target, how, exported), encoding="utf-8")
    return exported


def _readme(target: str, how: Target, exported: Exported) -> str:
    lines = [
        f"Exported by sfm-front export --to {target}: {how.summary}.",
        f"{exported.num_photos} photos, {exported.num_points} points.",
        *exported.notes,
        "",
        "Next, in this folder:",
        f"  {how.next_step.format(folder='.')}",
    ]
    return "\n".join(lines) + "\n"
