"""A program as a flat list of instructions, for its check and its execution alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robotd.api import DescriptorError, did_you_mean
from robotd.api.features import Section
from robotd.api.models import YamlNode
from robotd_teach.program_file import Condition, ProgramFile, Step, parse_program

MAX_STEPS = 5000  # with those of blocks, where they are called, and with `if`, `repeat` and `call`
MAX_TEXT = 100

_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_STYLE: dict[str, Any] = {
    "default_flow_style": True, "width": 10_000, "sort_keys": False, "allow_unicode": True
}  # fmt: skip

Keys = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Do:
    """Execute a step.

    Attributes:
        number: among the steps, from 1.
        keys: of its value in the file.
        line: of the file.
        text: for people, one line.
    """

    number: int
    step: Step
    keys: Keys
    line: int | None
    text: str

    @property
    def key(self) -> str:
        """``keys`` with dots."""
        return ".".join(map(str, self.keys))


@dataclass(frozen=True, slots=True)
class Begin:
    """Begin to repeat what is between here and ``end``, the index of ``Again``."""

    times: int | None
    end: int


@dataclass(frozen=True, slots=True)
class Again:
    """Go back to after ``begin``, the index of ``Begin``, unless that was the last time."""

    begin: int


@dataclass(frozen=True, slots=True)
class Branch:
    """Go to ``otherwise`` unless an input has its level."""

    condition: Condition
    otherwise: int
    keys: Keys


@dataclass(frozen=True, slots=True)
class Jump:
    """Go to ``target``, forward."""

    target: int


Instruction = Do | Begin | Again | Branch | Jump


@dataclass(frozen=True, eq=False)
class Program:
    """A program whose file is right; whether a robot can execute it is for ``ProgramCheck``.

    Attributes:
        path: of its file, for messages.
        text: of its file.
        file: its content.
        instructions: executed one after the other.
        steps: those that are steps.
    """

    path: Path
    text: str
    file: ProgramFile
    tree: YamlNode
    instructions: tuple[Instruction, ...]

    @classmethod
    def parse(cls, text: str, path: Path | str = "program.yaml") -> Program:
        """Return the program of a file's text. Raises DescriptorError with every mistake."""
        file, tree = parse_program(text, Path(path))
        return cls(Path(path), text, file, tree, tuple(_Assembler(file, tree).assemble()))

    @classmethod
    def read(cls, path: Path | str) -> Program:
        """Return the program of a file. Raises DescriptorError, OSError."""
        return cls.parse(Path(path).read_text(encoding="utf-8"), path)

    @property
    def steps(self) -> int:
        """Number of steps; those of blocks count where they are called."""
        return sum(isinstance(instruction, Do) for instruction in self.instructions)

    @property
    def paths(self) -> set[str]:
        """Names of the recorded paths that it plays."""
        steps = [code.step.path for code in self.instructions if isinstance(code, Do)]
        return {path.name for path in steps if path is not None and path.name is not None}

    def problem(self, keys: Keys, text: str) -> DescriptorError:
        """Return an error of a key, with file and line."""
        return problem(self.tree, keys, text)


def problem(tree: YamlNode, keys: Keys, text: str) -> DescriptorError:
    """Return an error of a key of a file, with its line."""
    node = tree.find(keys)
    return DescriptorError(text, path=node.path, line=node.line, key=".".join(map(str, keys)))


class _Assembler:
    """Lays the steps of a file one after the other, with those of blocks where they are called."""

    def __init__(self, file: ProgramFile, tree: YamlNode) -> None:
        self._file, self._tree = file, tree
        self._instructions: list[Any] = []
        self._steps = self._laid = 0
        self._problems: list[DescriptorError] = []
        self._calls: list[str] = []  # blocks that are being laid out
        self._called: set[str] = set()

    def assemble(self) -> list[Instruction]:
        self._lay(self._file.steps, ("steps",))
        kept, steps = self._instructions, self._steps
        for name in self._file.blocks:
            if name not in self._called:  # its mistakes count all the same
                self._instructions = []
                self._call(name, ("blocks", name))
        self._instructions, self._steps = kept, steps
        if self._problems:
            distinct = {str(error): error for error in self._problems}
            raise DescriptorError.join(distinct.values())
        return self._instructions

    def _lay(self, steps: Sequence[Step], keys: Keys) -> None:
        for index, step in enumerate(steps):
            self._lay_step(step, (*keys, index, step.kind))

    def _lay_step(self, step: Step, keys: Keys) -> None:
        code = self._instructions
        self._laid += 1
        if self._laid > MAX_STEPS:
            text = f"more than {MAX_STEPS} steps, with those of the blocks that are called"
            raise problem(self._tree, keys, text)
        if step.repeat is not None:
            begin = len(code)
            code.append(None)
            self._lay(step.repeat.steps, (*keys, "steps"))
            code[begin] = Begin(step.repeat.times, len(code))
            code.append(Again(begin))
        elif step.branch is not None:
            place = len(code)
            code.append(None)
            self._lay(step.branch.steps, (*keys, "steps"))
            end = len(code)
            code.append(None)
            code[place] = Branch(step.branch, len(code), keys)
            self._lay(step.branch.otherwise, (*keys, "else"))
            code[end] = Jump(len(code))
        elif step.call is not None:
            self._call(step.call, keys)
        else:
            self._steps += 1
            line = self._tree.find(keys).line
            code.append(Do(self._steps, step, keys, line, text_of(step)))

    def _call(self, name: str, keys: Keys) -> None:
        blocks = self._file.blocks
        if name not in blocks:
            hint = did_you_mean(name, blocks)
            text = f"there is no block {name!r} (available: {', '.join(blocks) or 'none'}){hint}"
            self._problems.append(problem(self._tree, keys, text))
        elif name in self._calls:
            cycle = " → ".join([*self._calls[self._calls.index(name) :], name])
            self._problems.append(problem(self._tree, keys, f"a block calls itself: {cycle}"))
        else:
            self._calls.append(name)
            self._called.add(name)
            self._lay(blocks[name], ("blocks", name))
            self._calls.pop()


def text_of(step: Step) -> str:
    """Return a step as a line of YAML."""
    value = step.value
    if step.message is not None and not step.message.wait:
        value = step.message.text
    return one_line({step.kind: value if isinstance(value, str) else shown(value)})


def shown(part: Section, but: frozenset[str] = frozenset()) -> dict[str, Any]:
    """Return what the file says of a part of a step, without the keys of ``but``."""
    content: dict[str, Any] = part.model_dump(
        exclude=set(but), exclude_none=True, exclude_defaults=True, by_alias=True
    )
    return content


def one_line(content: Mapping[str, Any]) -> str:
    """Return keys as a line of YAML, cut where it is long."""
    whole: str = yaml.dump(dict(content), Dumper=_DUMPER, **_STYLE)
    text = whole.strip()[1:-1]
    return text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 3]}..."
