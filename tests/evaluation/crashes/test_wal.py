"""A write-ahead log cut where we say a transaction ends holds exactly those before."""

from __future__ import annotations

import os
import shutil
import sqlite3
from contextlib import closing

from sfm_front.evaluation.crashes.wal import HEADER_BYTES, commit_ends, moved_until

NUM_COMMITS = 5


def test_commits_end_where_sqlite_says(tmp_path):
    file, copy = tmp_path / "a.db", tmp_path / "copy.db"
    with closing(sqlite3.connect(file, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("CREATE TABLE t (content BLOB)")
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        for _ in range(NUM_COMMITS):
            database.execute("INSERT INTO t VALUES (zeroblob(10000))")
        wal = tmp_path / "a.db-wal"
        ends = commit_ends(wal)
        assert len(ends) == NUM_COMMITS
        assert ends[-1] == wal.stat().st_size
        assert moved_until(wal, tmp_path / "a.db-shm") == HEADER_BYTES
        for whole, end in enumerate([HEADER_BYTES, *ends]):
            for cut in (end, end + 100):
                shutil.copyfile(file, copy)
                shutil.copyfile(wal, tmp_path / "copy.db-wal")
                os.truncate(tmp_path / "copy.db-wal", cut)
                with closing(sqlite3.connect(copy)) as opened:
                    assert opened.execute("SELECT count(*) FROM t").fetchone() == (whole,)
        database.execute("PRAGMA wal_checkpoint(PASSIVE)")
        assert moved_until(wal, tmp_path / "a.db-shm") == ends[-1]
        # The next round begins at the start of the file, before what is left of the last one.
        database.execute("INSERT INTO t VALUES (1)")
        assert len(commit_ends(wal)) == 1
