"""Modules run as programs: nothing of the working folder is taken for one of theirs."""

from __future__ import annotations

import subprocess

import pytest

from sfm_front.runtime.subprocess_env import module_command, module_environment


@pytest.mark.parametrize("safe", [None, "1"])
def test_files_in_the_working_folder_do_not_run(tmp_path, monkeypatch, safe):
    if safe is not None:
        monkeypatch.setenv("PYTHONSAFEPATH", safe)
    for name in ("json", "runpy", "sfm_front", "pycolmap"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('harm')")
    models = tmp_path / "models"
    models.mkdir()
    done = subprocess.run(
        module_command("sfm_front.mapping.refinement_process", str(models)),
        input="not a request\n",
        cwd=tmp_path,
        env=module_environment(),
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("failed: ")
    assert not models.exists()
