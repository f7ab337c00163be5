"""Global bundle adjustment beside a session: of a copy, whose changes are carried over."""

from __future__ import annotations

import json
import logging
import subprocess
import time
from dataclasses import asdict
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from threading import Thread

import pycolmap

from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.refinement_process import AdjustmentRequest
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.subprocess_env import module_command, module_environment

logger = logging.getLogger(__name__)

# A model that takes longer would be stale by then.
_PATIENCE_S = 600.0


class BackgroundAdjuster(Closeable):
    """Adjusts one model at a time in another process, which starts with the first one.

    ``is_busy``: a model is with that process. ``is_broken``: it has died, or has not answered for
    ten minutes, and nothing can be adjusted any more.
    """

    def __init__(self) -> None:
        self._folder: TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[str] | None = None
        self._answers: SimpleQueue[str] = SimpleQueue()
        self._due_s = 0.0
        self.is_busy = False
        self.is_broken = False
        self._ticket = 0

    @property
    def is_free(self) -> bool:
        """Whether it can take a model now."""
        return not self.is_busy and not self.is_broken

    def submit(self, reconstruction: pycolmap.Reconstruction, options: MapperOptions) -> int:
        """Begin to adjust a copy of a model as it is adjusted while it grows.

        Returns a ticket for ``result``. It must be free.
        """
        process = self._running()
        self._model.mkdir(exist_ok=True)
        reconstruction.write_binary(self._model)
        request = AdjustmentRequest(
            model=str(self._model),
            tolerance=options.convergence.global_tolerance,
            iterations=options.convergence.global_iterations,
            # The photos that come meanwhile need the others.
            num_threads=max(1, options.num_threads // 2),
            refine_intrinsics=options.refine_intrinsics,
            min_coverage_gain=options.coverage_gain(reconstruction.num_reg_images()),
        )
        assert process.stdin is not None
        try:
            process.stdin.write(json.dumps(asdict(request)) + "\n")
            process.stdin.flush()
        except OSError:
            self._break()
        self.is_busy = not self.is_broken
        self._due_s = time.monotonic() + _PATIENCE_S
        self._ticket += 1
        return self._ticket

    def poll(self) -> None:
        """Note whether the adjustment under way has ended."""
        if not self.is_busy:
            return
        try:
            answer = self._answers.get_nowait()
        except Empty:
            if time.monotonic() < self._due_s:
                return
            answer = ""
        self.is_busy = False
        if answer != "done":
            self._ticket += 1  # nobody has a ticket for this
            if answer:
                logger.warning("a model could not be refined beside the session: %s", answer)
            else:
                self._break()

    def result(self, ticket: int) -> pycolmap.Reconstruction | None:
        """The adjusted copy; None if it is still under way, failed, or another one came since."""
        if self.is_busy or self.is_broken or ticket != self._ticket:
            return None
        return pycolmap.Reconstruction(self._model)

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._folder is not None:
            self._folder.cleanup()

    @property
    def _model(self) -> Path:
        assert self._folder is not None
        return Path(self._folder.name) / "model"

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            self._folder = TemporaryDirectory(prefix="sfm_front_refinement_")
            self._process = subprocess.Popen(
                module_command("sfm_front.mapping.refinement_process", self._folder.name),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=module_environment(),
                encoding="utf-8",
                # Ctrl-C is for the session, which ends this with itself.
                start_new_session=True,
            )
            Thread(target=self._listen, args=(self._process,), daemon=True).start()
        return self._process

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            self._answers.put(line.strip())
        self._answers.put("")

    def _break(self) -> None:
        """Models are refined in the turn of a photo from now on."""
        logger.warning("the process that refines models has ended, or does not answer")
        self.is_broken = True
        if self._process is not None:
            self._process.kill()
