"""A page on this machine that follows a session, running or finished, by the files it writes.

``events.jsonl`` says what happens as it happens, the models in ``sparse/`` where everything is. The
page is a reader like any other: it runs in a process of its own, and knows no more than they say.
"""
