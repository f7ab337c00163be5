"""The answers of a photo search as a table, as rows for JSON, and as pictures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

from sfm_front.reports.words import one_line
from sfm_front.search.folder_search import Answer, Found, VerifiedMatches
from sfm_front.types import ExtractedPhoto

if TYPE_CHECKING:
    from PIL.Image import Image


def table(answer: Answer, relevant: Collection[str] | None, count: int) -> str:
    """The ``count`` best photos, one a line; ``-`` for inliers that were not counted."""
    seconds = ", ".join(f"{stage} {value:.3f}" for stage, value in answer.seconds.items())
    total = sum(answer.seconds.values())
    shown = answer.found[:count]
    width = max([len("photo"), *(len(found.photo.name) for found in shown)])
    lines = [
        f"{answer.query.name}: {len(answer.found)} photos ranked in {total:.3f} s ({seconds})",
        f"{'rank':>4}  {'photo':<{width}}  {'cosine':>7}  {'inliers':>7}",
    ]
    for rank, found in enumerate(shown, 1):
        inliers = "-" if found.inliers is None else str(found.inliers)
        mark = "  wrong" if _is_wrong(found, relevant) else ""
        lines.append(
            f"{rank:>4}  {found.photo.name:<{width}}  {found.cosine:>7.4f}  {inliers:>7}{mark}"
        )
    return "\n".join(map(one_line, lines))


def rows(answers: Sequence[Answer]) -> list[dict[str, Any]]:
    """A row per photo, query by query, best first; ``seconds`` are the query's."""
    return [
        {
            "query": answer.query.name,
            "rank": rank,
            "name": found.photo.name,
            "cosine": found.cosine,
            "inliers": found.inliers,
            "seconds": sum(answer.seconds.values()),
            **{f"{stage}_seconds": value for stage, value in answer.seconds.items()},
        }
        for answer in answers
        for rank, found in enumerate(answer.found, 1)
    ]


def sheet(answers: Sequence[Answer], relevant: Sequence[Collection[str] | None]) -> Image:
    """The contact sheet of all answers."""
    from sfm_front.viewers.contact_sheet import SHOWN, SheetRow, Tile, contact_sheet

    sheet_rows = []
    for answer, names in zip(answers, relevant, strict=True):
        tiles = [
            Tile(
                found.photo.path,
                f"{rank}  {found.photo.name}",
                _detail(found),
                wrong=_is_wrong(found, names),
            )
            for rank, found in enumerate(answer.found[:SHOWN], 1)
        ]
        query = Tile(answer.query.path, answer.query.name, "query")
        sheet_rows.append(SheetRow(query, tiles))
    return contact_sheet(sheet_rows)


def matches_picture(
    query: ExtractedPhoto, other: ExtractedPhoto, matches: VerifiedMatches
) -> Image:
    """Both photos and the lines between them."""
    from sfm_front.viewers.match_drawing import draw_matches

    return draw_matches(
        query.path,
        other.path,
        matches.xy1,
        matches.xy2,
        ((query.width, query.height), (other.width, other.height)),
        f"{query.name} and {other.name}: {len(matches.xy1)} verified of "
        f"{matches.tentative} SIFT matches",
    )


def _is_wrong(found: Found, relevant: Collection[str] | None) -> bool:
    return relevant is not None and found.photo.name not in relevant


def _detail(found: Found) -> str:
    cosine = f"cosine {found.cosine:.3f}"
    return cosine if found.inliers is None else f"{cosine}, {found.inliers} inliers"
