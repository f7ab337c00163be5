"""``report.html``: a finished output on one page, that opens without a network."""

FILE = "report.html"
