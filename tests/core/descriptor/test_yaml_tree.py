import contextlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robotd.descriptor.yaml_tree import MAX_BYTES, MAX_VALUES, read_yaml
from robotd.errors import DescriptorError

BOMB = "a: &a [x, x]\n" + "".join(f"b{i}: &b{i} [*a, *a]\n" for i in range(9))


def read(tmp_path: Path, text: str | bytes) -> object:
    path = tmp_path / "robot.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_yaml(path).plain()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("-2", -2),
        ("0.5", 0.5),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("2020-01-01", "2020-01-01"),
        ("~", None),
        ("", None),
        ("true", True),
        ("'1'", "1"),
        ("[1, a, null]", [1, "a", None]),
        ("9" * 4096, float("inf")),
    ],
)
def test_plain_scalars_are_those_of_json(tmp_path: Path, text: str, value: object) -> None:
    assert read(tmp_path, f"key: {text}") == {"key": value}


def test_every_value_knows_its_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("a: 1\nb:\n  c:\n    - x\n    - {d: 1,\n       e: 2}\n")
    tree = read_yaml(path)
    lines = [tree.find(keys).line for keys in (["a"], ["b"], ["b", "c", 1], ["b", "c", 1, "e"])]
    assert lines == [1, 2, 5, 6]
    assert tree.find(["b", "nowhere", 3]).line == 2


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", 3, "key 'a' was given before, on line 1"),
        ("a: &x 1\nb: *x\n", 2, r"alias \*x"),
        (BOMB, 2, "alias"),
        ("a: !!python/object/apply:os.system [x]\n", 1, "tag .* is not allowed"),
        ("a: 1\n---\nb: 2\n", 3, "a second document"),
        ("a: [1\nb: 2", 2, "not valid YAML"),
        ("a:\n\t- 1", 2, "not valid YAML: the line is indented by a tab: use spaces"),
        ("a: 1\n\tb: 2", 2, "not valid YAML: the line is indented by a tab: use spaces"),
        ('a: 1\nb: "x\nc: 2\n', 4, "unexpected end of stream, while scanning .* from line 2"),
        ("? [a]\n: 1\n", 1, "a key must be a word"),
        ("- a\n", 1, "must be a mapping"),
        ("", 1, "must be a mapping"),
        ("a: " + "[" * 500, 1, "deeper than 20"),
        ("a: " + "[" * 100_000, 1, "deeper than 20"),
        (b"a: 1\nb: \xff", 2, "not UTF-8"),
        ("a: é\nb: \0", 2, "not valid YAML: control characters"),
        ("a:\n" + "- []\n" * MAX_VALUES, MAX_VALUES, "more than 10_000 values"),
        ("a: 1\n? " + "b" * 101 + "\n: 1", 2, "a key is longer than 100 characters"),
        ("a: 1\nb: " + "9" * 4097, 2, "a text is longer than 4096 characters"),
        ("a: x\n" + "#" * MAX_BYTES, None, "larger than the limit of 1_000_000"),
    ],
)
def test_refusals_name_the_line(
    tmp_path: Path, text: str | bytes, line: int | None, message: str
) -> None:
    with pytest.raises(DescriptorError, match=message) as caught:
        read(tmp_path, text)
    assert caught.value.path == tmp_path / "robot.yaml"
    assert caught.value.line == line


def test_several_refusals_come_at_once(tmp_path: Path) -> None:
    with pytest.raises(DescriptorError) as caught:
        read(tmp_path, "a: &x 1\nb: *x\na: 2\n")
    assert len(str(caught.value).splitlines()) == 2


def test_what_is_no_file_is_rejected(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nothing", Path("a\0b"), Path("x" * 5000)):
        with pytest.raises(DescriptorError):
            read_yaml(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.one_of(st.binary(max_size=200), st.text("ab: \n-[]{}*&!|>#'\"?,1.e~", max_size=60)))
def test_no_bytes_crash_the_reader(tmp_path: Path, data: bytes | str) -> None:
    with contextlib.suppress(DescriptorError):
        assert isinstance(read(tmp_path, data), dict)
