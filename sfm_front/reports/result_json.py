"""The result of a run as one object for other programs: what ``--json`` prints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sfm_front.reports import html, report_json
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.verdict import verdict

VERSION = 1
"""Raised when a key changes its meaning or goes; new keys leave it as it is."""


def result(summary: RunSummary, output: Path) -> dict[str, Any]:
    """Ready for JSON: the verdict, where things are, and ``report.json`` but for its photos, of
    which only those are named that are in no model."""
    found = verdict(summary, summary.sidecar)
    content = report_json.as_content(summary)
    return {
        "version": VERSION,
        "verdict": {"level": found.level.value, "sentence": found.sentence},
        "output": str(output),
        "report_html": str(output / html.FILE),
        "report_json": str(output / report_json.FILE),
        "models": [{**model, "path": str(output / model["path"])} for model in content["models"]],
        "in_no_model": [
            {"name": photo.name, "why": photo.why_not, "what_would_help": photo.hint}
            for photo in summary.used
            if photo.model is None
        ],
        "skipped": [{"name": photo.name, "why": str(photo)} for photo in summary.skipped],
        **{key: content[key] for key in ("georeference", "cameras", "look_alikes", "totals")},
    }
