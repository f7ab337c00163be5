"""Print a table of what became of each photo, from the files in an output folder.

    python scripts/examples/read_report.py OUTPUT

Needs nothing but Python: ``report.json`` and ``retrieval.jsonl`` are plain JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

COLUMNS = ("photo", "registered", "most relevant", "verified pairs", "seconds")


def table_rows(output: Path) -> list[tuple[str, ...]]:
    """One row per photo, in order of arrival."""
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    # retrieval.jsonl has one line per photo that was not skipped.
    lines = (output / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()
    retrieved = {line["name"]: line for line in map(json.loads, lines)}
    return [table_row(photo, retrieved.get(photo["name"], {})) for photo in report["photos"]]


def table_row(photo: dict[str, Any], retrieval: dict[str, Any]) -> tuple[str, ...]:
    """``photo`` is from report.json, ``retrieval`` from retrieval.jsonl, empty if skipped."""
    if photo["skipped"]:
        return (photo["name"], f"skipped: {photo['skipped']['reason']}", "-", "-", "-")
    verified = sum(candidate["verified"] for candidate in retrieval["candidates"])
    seconds = sum(photo["seconds"].values())
    return (
        photo["name"],
        "yes" if photo["registered"] else "no",
        retrieval["most_relevant"] or "-",
        str(verified),
        f"{seconds:.2f}",
    )


def main() -> None:
    """Print the table with aligned columns."""
    parser = argparse.ArgumentParser(description="Print what became of each photo.")
    parser.add_argument("output", type=Path, help="a folder that a session has written to")
    try:
        rows = [COLUMNS, *table_rows(parser.parse_args().output)]
    except FileNotFoundError as error:
        sys.exit(f"{error.filename}: no such file. Give the output of a finished session.")
    widths = [max(len(row[column]) for row in rows) for column in range(len(COLUMNS))]
    for row in rows:
        print(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )


if __name__ == "__main__":
    main()
