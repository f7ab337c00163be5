"""What a shell proposes after the script of ``--print-completion``."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from sfm_front.cli.completion import SHELLS
from sfm_front.cli.main import main
from sfm_front.exporters.registry import TARGETS


def script(capsys: pytest.CaptureFixture[str], shell: str) -> str:
    with pytest.raises(SystemExit) as left:
        main(["--print-completion", shell])
    assert left.value.code == 0
    return capsys.readouterr().out


@pytest.fixture
def proposed(capsys, tmp_path):
    """Asks a bash in ``tmp_path`` what it proposes for the last of some words."""
    if shutil.which("bash") is None:
        pytest.skip("there is no bash")
    file = tmp_path / "completion.bash"
    file.write_text(script(capsys, "bash"))

    def ask(*words: str) -> set[str]:
        quoted = " ".join(f"'{word}'" for word in ("sfm-front", *words))
        asked = (
            f". {file}; COMP_WORDS=({quoted}); COMP_CWORD={len(words)}; "
            '_shtab_sfm_front; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run(
            ["bash", "-c", asked], capture_output=True, text=True, cwd=tmp_path, check=True
        )
        return set(done.stdout.split())

    return ask


def test_commands_options_and_values_are_proposed(proposed):
    assert proposed("re") == {"reconstruct", "retrieve", "report"}
    assert proposed("reconstruct", "--qual") == {"--quality"}
    assert proposed("reconstruct", "photos", "--quality", "") >= {"draft", "normal", "high"}
    assert proposed("export", "out", "--to", "") >= set(TARGETS)


def test_folders_and_files_are_proposed_where_they_are_wanted(proposed, tmp_path: Path):
    (tmp_path / "flight").mkdir()
    (tmp_path / "flight.toml").touch()
    assert proposed("reconstruct", "fli") == {"flight"}
    assert proposed("reconstruct", "--config", "fli") == {"flight", "flight.toml"}


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_a_script(capsys, shell):
    told = script(capsys, shell)
    assert "sfm-front" in told
    assert "snapshot-seconds" in told
