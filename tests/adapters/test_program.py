from __future__ import annotations

import contextlib
import json
import tracemalloc
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.adapters.base import CAPABILITIES, Traits
from bench.adapters.program import Program, Timeouts, parse_toml, program_of, read_program
from bench.adapters.session import MAX_LINE_BYTES, one_line, parse_message
from bench.adapters.worker import Worker
from bench.errors import BadConfig, MethodFailed

SMALLEST = {"name": "mine", "command": ["python", "x.py"], "capabilities": ["transfers"]}
PATH = Path("/somewhere/adapter.toml")

SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner), max_leaves=12
)
KEYS = st.sampled_from([*Program.model_fields, "start_s", "needs_style_label"]) | st.text(max_size=10)


def test_all_keys_arrive() -> None:
    table = {
        **SMALLEST,
        "title": "Mine",
        "motions": "bvh",
        "fits": True,
        "timeouts": {"task_s": 3},
        "traits": {"needs_style_label": True, "look_ahead_frames": 0},
        "environment": {"A": "1"},
    }
    program = program_of(table, PATH)
    assert (program.title, program.motions, program.fits, program.timeouts.task_s) == ("Mine", "bvh", True, 3.0)
    assert (program.traits.needs_style_label, program.traits.look_ahead_frames) == (True, 0)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"comand": []}, "no key 'comand'; remedy: did you mean 'command'"),
        ({"name": "Mine!"}, "name: String should match pattern"),
        ({"name": "../x"}, "name: String should match pattern"),
        ({"command": []}, "command: Tuple should have at least 1 item"),
        ({"command": "python x.py"}, "command: Input should be a valid tuple"),
        ({"capabilities": ["flies"]}, "no capability 'flies'.*choose from transfers"),
        ({"motions": "pickle"}, "motions: Input should be 'npz' or 'bvh'"),
        ({"fits": "yes"}, "fits: Input should be a valid boolean"),
        ({"timeouts": {"task": 1}}, "no key 'timeouts.task'; remedy: did you mean 'task_s'"),
        ({"timeouts": {"task_s": 0}}, "timeouts.task_s: Input should be greater than 0"),
        ({"traits": {"needs_labels": True}}, "no trait 'needs_labels'"),
        ({"traits": {"needs_style_label": "no"}}, "traits.needs_style_label: Input should be a valid boolean"),
        ({"traits": 1}, "traits must be a table"),
        ({"traits": {"trained_on": "a\nb"}}, "traits.trained_on: must be one line of printable text"),
        ({"title": "a\u202eb"}, "title: Value error, must be one line of printable text"),
        ({"description": "a\tb"}, "description: Value error, must be one line of printable text"),
        ({"toml_file": "/etc/passwd"}, "no key 'toml_file'"),
    ],
)
def test_wrong_keys_and_values_are_named(change: dict[str, object], match: str) -> None:
    with pytest.raises(BadConfig, match=match):
        program_of({**SMALLEST, **change}, PATH)


def test_files_that_are_no_toml_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "adapter.toml"
    with pytest.raises(BadConfig, match="cannot be read"):
        read_program(path)
    for content, match in ((b"\xff", "is not TOML"), (b"a = [" * 9000, "is not TOML"), (b" " * 70000, "larger than")):
        path.write_bytes(content)
        with pytest.raises(BadConfig, match=match):
            read_program(path)


@given(st.dictionaries(KEYS, VALUES, max_size=6))
def test_any_table_raises_only_ours(table: dict[str, object]) -> None:
    with contextlib.suppress(BadConfig):
        program_of({**SMALLEST, **table}, PATH)


@given(st.text(max_size=300) | st.from_regex(r"[\[\]{}=\"'a-z0-9.,#\n ]{0,200}", fullmatch=True))
def test_any_toml_raises_only_ours(text: str) -> None:
    with contextlib.suppress(BadConfig):
        parse_toml(text.encode("utf-8", "surrogatepass"), "x")


@given(st.binary(max_size=300))
def test_any_line_raises_only_ours(line: bytes) -> None:
    with contextlib.suppress(MethodFailed):
        parse_message(line)


@given(VALUES | st.dictionaries(st.sampled_from(["id", "ok", "event", "what", "done", "total", "error"]), VALUES))
def test_any_json_line_raises_only_ours(value: object) -> None:
    try:
        message = parse_message(json.dumps(value).encode())
    except MethodFailed:
        return
    assert message.get("event") in (None, "heartbeat", "progress")


@pytest.mark.parametrize("line", [b"[" * MAX_LINE_BYTES, b'{"a":' * (MAX_LINE_BYTES // 5), b"9" * MAX_LINE_BYTES])
def test_long_lines_take_bounded_memory(line: bytes) -> None:
    tracemalloc.start()
    with pytest.raises(MethodFailed):
        parse_message(line)
    assert tracemalloc.get_traced_memory()[1] < 32 * MAX_LINE_BYTES
    tracemalloc.stop()


@given(st.text())
def test_foreign_text_becomes_one_printable_line(text: str) -> None:
    shown = one_line(text)
    assert len(shown) <= 300
    assert shown.isprintable()


def test_docs_name_every_key_and_every_call() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "adding-a-method.md").read_text()
    keys = {*Program.model_fields, *Timeouts.model_fields, *(field.name for field in fields(Traits))}
    keys -= {"toml_file", "environment", "traits", "timeouts"}
    calls = {name.removeprefix("_on_") for name in vars(Worker) if name.startswith("_on_")}
    for word in (*keys, *CAPABILITIES, *calls, "cancel", "stop", "[environment]", "[traits]", "[timeouts]"):
        assert f"`{word}`" in page, word
