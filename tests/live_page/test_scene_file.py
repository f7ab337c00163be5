"""``scene.html``, and what happens without the extra."""

from __future__ import annotations

from importlib import metadata

import pytest
from helpers.live_session import orbit, photos_of, run_session
from helpers.positioned_stream import options

from sfm_front.cli.main import main
from sfm_front.errors import InputError
from sfm_front.live_page.extra import is_installed, scene_if_possible
from sfm_front.session.session import Session

needs_viser = pytest.mark.skipif(not is_installed(), reason="needs viser: pip install viser")


@needs_viser
def test_the_report_command_writes_it_beside_the_page(tmp_path, capsys):
    output = run_session(tmp_path / "<b> out", photos_of(orbit(12), tmp_path / "photos"))
    assert main(["report", str(output)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in said] == [
        f"wrote {output / 'report.html'}",
        f"wrote {output / 'scene.html'}",
    ]
    assert 'href="scene.html"' in (output / "report.html").read_text(encoding="utf-8")
    page = (output / "scene.html").read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in page
    assert "<title>&lt;b&gt; out</title>" in page
    assert len(page) < 3_000_000
    # Another session may take its place.
    run = ["reconstruct", str(tmp_path / "photos"), "--output", str(output), "--overwrite"]
    main([*run, "--max-features", "50", "--global-descriptor", "vlad"])
    assert not (output / "scene.html").exists()


@needs_viser
@pytest.mark.parametrize(
    ("finish", "says"),
    [(True, "finished at"), (False, "stopped at"), (None, "as far as it was at")],
)
def test_it_says_of_when_it_is(tmp_path, finish, says):
    from sfm_front.live_page.scene_file import write_scene

    output = tmp_path / "<b>"
    with Session(output, options()) as session:
        for photo in photos_of(orbit(12), tmp_path / "photos"):
            session.add_extracted(photo)
        session._write_snapshot()
        if finish:
            session.finish()
        elif finish is None:
            write_scene(output)
    if finish is not None:
        write_scene(output)
    page = (output / "scene.html").read_text(encoding="utf-8")
    assert f"points, {says} " in page
    assert ">&lt;b&gt;: 1" in page


@needs_viser
def test_without_a_model_there_is_none(tmp_path):
    from sfm_front.live_page.scene_file import write_scene

    assert scene_if_possible(tmp_path) is None
    with pytest.raises(InputError, match="no model"):
        write_scene(tmp_path)


@pytest.mark.parametrize("version", ["1.0.21", None])
def test_without_the_extra_a_line_says_what_to_install(tmp_path, monkeypatch, capsys, version):
    def find(_: str) -> str:
        if version is None:
            raise metadata.PackageNotFoundError
        return version

    monkeypatch.setattr(metadata, "version", find)
    (tmp_path / "photos").mkdir()
    assert main(["view", str(tmp_path), "--web"]) == 2
    assert capsys.readouterr().err.count("pip install 'sfm-front[live]'") == 1
    assert scene_if_possible(tmp_path) is None


def test_a_folder_without_anything_to_show_is_refused(tmp_path, capsys):
    assert main(["view", str(tmp_path), "--web"]) == 2
    said = capsys.readouterr().err
    assert "no session and no model" in said or "sfm-front[live]" in said
