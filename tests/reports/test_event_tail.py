"""Lines of a file that grows, is torn, or is replaced."""

from __future__ import annotations

from sfm_front.reports.event_tail import EventTail


def test_only_what_is_new_is_read(tmp_path):
    file = tmp_path / "events.jsonl"
    tail = EventTail(file)
    assert tail.new() == ([], False)
    file.write_text('{"n": 1}\n')
    assert tail.new() == ([{"n": 1}], True)
    assert tail.new() == ([], False)
    with file.open("a") as more:
        more.write('{"n": 2}\n{"n": 3}\n')
    assert tail.new() == ([{"n": 2}, {"n": 3}], False)


def test_a_line_that_is_not_whole_is_waited_for(tmp_path):
    file = tmp_path / "events.jsonl"
    tail = EventTail(file)
    line = '{"name": "süd.jpg"}\n'.encode()
    for end in range(1, len(line)):
        file.write_bytes(line[:end])
        assert tail.new()[0] == []
    file.write_bytes(line)
    assert tail.new()[0] == [{"name": "süd.jpg"}]


def test_what_is_no_object_is_left_out(tmp_path):
    file = tmp_path / "events.jsonl"
    deep = "[" * 100_000
    file.write_bytes(b'\xff\n3\nnull\n{"n": 1\n' + deep.encode() + b'\n{"n": 2}\n')
    assert EventTail(file).new()[0] == [{"n": 2}]


def test_another_file_in_its_place_begins_anew(tmp_path):
    file = tmp_path / "events.jsonl"
    tail = EventTail(file)
    file.write_text('{"n": 1}\n{"n": 2}\n')
    tail.new()
    file.write_text('{"n": 3}\n')  # The same file, shorter.
    assert tail.new() == ([{"n": 3}], True)
    fresh = tmp_path / "fresh"
    fresh.write_text('{"n": 4}\n{"n": 5}\n')
    fresh.replace(file)
    assert tail.new() == ([{"n": 4}, {"n": 5}], True)
