"""The arguments of ``reconstruct``, and the session's options that they give."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sfm_front.cli import arguments as shared
from sfm_front.errors import ConfigError

if TYPE_CHECKING:
    from sfm_front.session.options import SessionOptions

_EXIT_STATUS = """\
exit status: 0 models were written, 1 there is no model, 2 a mistake in what was given. The first
Ctrl-C, SIGTERM or SIGHUP finishes with the photos taken so far, with 0 or 1 as ever; a second one,
or one before the first photo, leaves at once: 130 for Ctrl-C, 143 for SIGTERM, 129 for SIGHUP.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``reconstruct``. Defaults left out here are the session's."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _EXIT_STATUS
    parser.set_defaults(usage_error=parser.error)
    parser.add_argument("folder", type=Path, nargs="?", help="photos, sub-folders included")
    parser.add_argument(
        "--output",
        type=_folder,
        help="where to write (default: outputs/NAME, by the folder's name, or by its parent's "
        "if it is called images)",
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace a reconstruction that is there, instead of continuing it",
    )
    parser.add_argument(
        "--append",
        action="store_true",
        help="add these photos to the reconstruction of another folder, given by --output",
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="go on with photos that appear in the folder, until Ctrl-C or --idle-timeout",
    )
    parser.add_argument(
        "--idle-timeout",
        type=float,
        metavar="SECONDS",
        help="with --watch, finish when no photo has come for that long",
    )
    parser.add_argument(
        "--viewer",
        action="store_true",
        help="a page for browsers on this machine that shows the models grow; needs the extra live",
    )
    parser.add_argument(
        "--snapshot-seconds",
        type=float,
        metavar="SECONDS",
        help="age of the models in sparse/ while photos arrive (default: 30)",
    )
    parser.add_argument(
        "--cache-mb",
        type=int,
        metavar="MB",
        help="memory for features of earlier photos (default: a quarter of the machine's memory, "
        "at most 2048)",
    )
    parser.add_argument(
        "--events",
        choices=["-"],
        help="with -, print what happens as lines of JSON instead of the progress line",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print the result as one JSON object; all else goes to standard error",
    )
    parser.add_argument(
        "--text",
        action=argparse.BooleanOptionalAction,
        help="whether to write models as text too; photo names must not hold spaces then",
    )
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="TOML of options; flags given here win over it"
    )
    parser.add_argument(
        "--print-config",
        action="store_true",
        help="print all options as such a file, and do nothing else",
    )
    photos = parser.add_argument_group("photos")
    photos.add_argument(
        "--order", default="name", help="name, time of capture, or random (default: %(default)s)"
    )
    photos.add_argument(
        "--seed",
        type=int,
        help="of --order random and of all RANSAC (default: 0)",
    )
    photos.add_argument(
        "--quality",
        choices=("draft", "normal", "high"),
        help="of photos as they are looked at: draft (800 px, 2000 features: mostly half the time, "
        "and photos with little overlap may find no place), normal (default), or high (2400 px, "
        "8000 features: more points). The next two win over it",
    )
    shared.add_photos(photos)
    cameras = parser.add_argument_group("cameras")
    cameras.add_argument(
        "--camera-mode",
        help="which photos share one: auto (default), single, per-folder or per-image",
    )
    cameras.add_argument(
        "--camera-model",
        help="any of COLMAP's, which stays; or auto (default): SIMPLE_RADIAL, which becomes RADIAL "
        "or OPENCV at the end where the photos bear it out",
    )
    cameras.add_argument(
        "--camera-params", metavar="F,CX,CY,…", help="known calibration, in COLMAP's order"
    )
    positions = parser.add_argument_group("positions")
    positions.add_argument(
        "--gps",
        metavar="FILE",
        help="positions of photos: CSV (name,lat,lon,alt[,h_acc,v_acc]) or ODM's geo.txt; photos "
        "that it does not name keep those of their EXIF. off: none at all; exif (default)",
    )
    positions.add_argument(
        "--gps-accuracy",
        metavar="H[,V]",
        help="their standard deviation in metres, horizontal and vertical (default: 5,10; without "
        "V, twice H), where the file or the photo does not say it",
    )
    positions.add_argument(
        "--georegister",
        choices=("auto", "off"),
        help="auto (default): models are in metres, east, north and up, as soon as positions fix "
        "that; off: they stay in a frame of their own",
    )
    positions.add_argument(
        "--gcp",
        type=Path,
        metavar="FILE",
        help="control points, to which the model is held at the end: ODM's gcp_list.txt; points "
        "whose name ends in _check are only measured",
    )
    positions.add_argument(
        "--gcp-size",
        metavar="W,H",
        help="pixels of the photos in which they were marked, if the photos were reduced since",
    )
    positions.add_argument(
        "--gcp-accuracy",
        metavar="H[,V]",
        help="their standard deviation in metres, horizontal and vertical (default: 0.02,0.03; "
        "without V, twice H), where the file does not say it",
    )
    retrieval = parser.add_argument_group("retrieval")
    shared.add_retrieval(retrieval)
    retrieval.add_argument(
        "--num-matched",
        "--matched",
        type=int,
        metavar="N",
        help="best of them matched on all features (default: 8)",
    )
    shared.add_machine(parser)
    cluster = parser.add_argument_group("cluster")
    cluster.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="work on a Dask cluster, needs the extra cluster: tcp://HOST:PORT of a scheduler, or "
        "local:N for N workers on this machine",
    )
    cluster.add_argument(
        "--group-size",
        type=int,
        metavar="N",
        help="photos of which one worker grows a model (default: 300)",
    )


def session_options(arguments: argparse.Namespace) -> SessionOptions:
    """What was given on the command line; the rest is of ``--config``, or the default."""
    from sfm_front.cli.config_file import read_options
    from sfm_front.session.options import SessionOptions
    from sfm_front.session.quality import QUALITIES

    base = SessionOptions() if arguments.config is None else read_options(arguments.config)
    given: dict[str, Any] = {}
    if arguments.quality is not None:
        given |= asdict(QUALITIES[arguments.quality])
    given |= shared.given(arguments, base.retrieval)
    if arguments.num_matched is not None:
        given["pair_matching"] = replace(base.pair_matching, num_matched=arguments.num_matched)
    if arguments.text is not None:
        given["text"] = arguments.text
    for name in ("seed", "snapshot_seconds", "cache_mb", "georegister"):
        if getattr(arguments, name) is not None:
            given[name] = getattr(arguments, name)
    cameras = {
        "mode": arguments.camera_mode,
        "model": arguments.camera_model,
        "params": _numbers("--camera-params", arguments.camera_params),
    }
    given["cameras"] = replace(
        base.cameras, **{name: value for name, value in cameras.items() if value is not None}
    )
    positions = _sigmas("--gps-accuracy", arguments.gps_accuracy)
    if arguments.gps is not None:
        positions["source"] = arguments.gps
    given["positions"] = replace(base.positions, **positions)
    control = _sigmas("--gcp-accuracy", arguments.gcp_accuracy)
    if arguments.gcp is not None:
        control["file"] = arguments.gcp
    size = _numbers("--gcp-size", arguments.gcp_size)
    if size is not None:
        if len(size) != 2 or any(side % 1 != 0 or side < 1 for side in size):
            raise ConfigError(f"--gcp-size takes width and height, got {arguments.gcp_size!r}")
        control["marked_size"] = tuple(map(int, size))
    points = replace(base.control_points, **control)
    if (control or points.marked_size is not None) and points.file is None:
        flag = "--gcp-accuracy" if points.marked_size is None else "--gcp-size"
        raise ConfigError(f"{flag} says how control points are: give them with --gcp FILE")
    given["control_points"] = points
    return replace(base, **given)


def _sigmas(argument: str, text: str | None) -> dict[str, Any]:
    """Options of these names, if it was given."""
    sigmas = _numbers(argument, text)
    if sigmas is None:
        return {}
    if len(sigmas) > 2:
        raise ConfigError(f"{argument} takes one or two numbers, got {len(sigmas)}")
    vertical = sigmas[1] if len(sigmas) == 2 else 2 * sigmas[0]
    return {"horizontal_sigma_m": sigmas[0], "vertical_sigma_m": vertical}


def _numbers(argument: str, text: str | None) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"{argument} takes numbers separated by commas, got {text!r}") from None


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("give a folder, or leave --output out")
    return Path(text)
