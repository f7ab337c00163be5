"""``report.html``: a finished output on one page, that opens without a network."""

FILE = "report.html"
SCENE_FILE = "scene.html"
"""The models to turn in a browser, beside the page."""
