"""What speaks against the models: pairs that contradict them, places that look alike."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.reports.html.markup import Html, joined, section, table, tag
from sfm_front.reports.html.material import Material

_MOST_NAMED = 8


def doubts(material: Material) -> Html | None:
    """None without models."""
    summary = material.summary
    if not summary.models:
        return None
    rows = []
    for number, model in enumerate(summary.models):
        audit = model.audit
        if audit is None:
            continue
        verdict = ("missing", "doubtful") if audit.is_doubtful else ("placed", "sound")
        rows.append(
            [
                f"{number}: {model.num_registered} photos",
                tag("span", verdict[1], class_=f"state {verdict[0]}"),
                f"{audit.num_contradicted} of {audit.num_pairs}",
                f"{100 * audit.contradicted_share:.2f} %",
                _named(audit.worst_groups[-1]) if audit.worst_groups else "",
            ]
        )
    head = ("model", "verdict", "pairs against it", "their matches", "look first at")
    alike = [
        tag("li", f"{_named(first)} and {_named(second)}") for first, second in summary.look_alikes
    ]
    return section(
        "doubts",
        "What speaks against it",
        table(head, rows, numbers_from=5) if rows else None,
        joined([tag("h3", "Taken for one place and taken apart"), tag("ul", joined(alike))])
        if alike
        else tag("p", "No places were found that only look alike.", class_="note"),
    )


def _named(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more
