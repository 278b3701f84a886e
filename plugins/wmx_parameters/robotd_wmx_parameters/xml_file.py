"""Reading and writing of WMX parameter files, in the layout of the engine."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from robotd.api import DescriptorError, FloatArray, did_you_mean, read_limited
from robotd_wmx_parameters.element_table import (
    AXIS_SECTIONS,
    GLOBAL_SECTIONS,
    Kind,
    Parameter,
    Sections,
)
from robotd_wmx_parameters.parameters import (
    N_AXES,
    Column,
    Scalar,
    WmxParameters,
    axes_text,
    checked_column,
    column_problems,
    gear_problems,
)

MAX_BYTES = 4_000_000
"""A complete file has 1.1 MB."""
MAX_MARKUP = 150_000
"""Tags and attributes; a complete file has 44 000. Freeing more would delay the control loop."""
VERSION = "1.00"

IntArray = NDArray[np.int64]

_MAX_PROBLEMS = 1000  # then reading ends: each costs a search for the nearest known word
_SHOWN = 40  # characters of a value or a word
_NUMBER = re.compile(r"\s*[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,3})?\s*", re.ASCII)


@dataclass
class _Cells:
    """Values of one kind of block: rows of elements, columns of axes; NaN: not stated."""

    sections: Sections
    count: int
    items: list[tuple[str, Parameter]] = field(init=False)
    tree: dict[str, Any] = field(init=False)  # tag → subtree, or row of a leaf
    values: FloatArray = field(init=False)
    lines: IntArray = field(init=False)

    def __post_init__(self) -> None:
        self.items = [(tag, item) for tag, items in self.sections.items() for item in items]
        self.tree = {}
        for row, (section, item) in enumerate(self.items):
            *tags, leaf = (section, *item.name.split("/"))
            subtree = self.tree
            for tag in tags:
                subtree = subtree.setdefault(tag, {})
            subtree[leaf] = row
        self.values = np.full((len(self.items), self.count), np.nan)
        self.lines = np.zeros((len(self.items), self.count), np.int64)


def read_wmx_parameters(path: Path, axes: int = 0) -> WmxParameters:
    """Read a parameter file of either generation of the engine.

    Elements that the file does not state get the vendor's default and are listed in
    ``missing``. About 17 ms for a complete file of 128 axes, 1 ms for one that was read before and
    has not changed.

    Args:
        axes: number of axes of the robot; the file must state each of them, from axis 0. An axis
            with nothing but defaults would have the gear ratio 1/1: a radian would be a count.

    Raises:
        DescriptorError: not such a file, or anything in it is unknown, doubled, not a number
            or out of range; every problem with its line, element, value and limit. Or axes of
            the robot are not in it; all are named.
    """
    parameters = _parameters(path, read_limited(path, MAX_BYTES))
    if absent := parameters.absent_axes(axes):
        raise DescriptorError(
            f"nothing is stated for {axes_text(absent)} of a robot with {axes} axes: without"
            " gear ratio and polarity their positions mean nothing; add the AxisParameters blocks",
            path=path,
        )
    return parameters


@lru_cache(maxsize=2)  # a start reads it to place the joints, to check it and for the engine
def _parameters(path: Path, data: bytes) -> WmxParameters:
    return _Reader(path).read(data)


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._problems: list[DescriptorError] = []
        self._axes = _Cells(AXIS_SECTIONS, N_AXES)
        self._globals = _Cells(GLOBAL_SECTIONS, 1)
        # Content of an axis block → its values, and their lines counted from the block's first.
        self._contents: dict[bytes, tuple[FloatArray, IntArray]] = {}

    def read(self, data: bytes) -> WmxParameters:
        root = _parse(self._path, data)
        if root.tag != "Parameters" or root.get("ver", VERSION) != VERSION:
            what = f'root must be <Parameters ver="{VERSION}">'
            raise DescriptorError(what, path=self._path, line=root.sourceline)
        for block in root:
            if block.tag == "GlobalParameters":
                self._block(block, self._globals.tree, self._globals, 0, "GlobalParameters")
            elif block.tag == "AxisParameters":
                self._axis(block)
            else:
                self._unknown(block, ("GlobalParameters", "AxisParameters"), "Parameters")
            block.clear()  # freeing the whole tree at the end would hold the interpreter for 3 ms
        missing: dict[str, tuple[int, ...]] = {}
        global_columns = self._columns(self._globals, missing)
        columns = self._columns(self._axes, missing)
        self._check_gears(columns)
        values = {item.name: column[0].item() for item, column in global_columns}
        return WmxParameters(dict(_named(columns)), values, missing, self._path)

    def _axis(self, block: Any) -> None:
        text = block.get("Axis", "")
        if not re.fullmatch("[0-9]{1,3}", text, re.ASCII) or int(text) >= N_AXES:
            what = f"Axis must be a whole number from 0 to {N_AXES - 1} (value {text!r})"
            self._refuse(what, block.sourceline, "AxisParameters")
        else:
            self._axis_block(block, int(text))

    def _axis_block(self, block: Any, axis: int) -> None:
        """Read a block, or copy the values of one with equal content.

        A complete file has the same block for all axes that are not used: 122 of 128 of the CR3A.
        """
        cells, problems = self._axes, len(self._problems)
        content = etree.tostring(block, with_tail=False).partition(b">")[2]
        is_new = bool(np.isnan(cells.values[:, axis]).all())
        if is_new and content in self._contents:
            values, lines = self._contents[content]
            cells.values[:, axis], cells.lines[:, axis] = values, lines + block.sourceline
            return
        self._block(block, cells.tree, cells, axis, f"axis{axis}")
        if is_new and len(self._problems) == problems:
            lines = cells.lines[:, axis] - block.sourceline
            self._contents[content] = cells.values[:, axis].copy(), lines

    def _block(self, block: Any, tree: dict[str, Any], cells: _Cells, axis: int, key: str) -> None:
        for child in block:
            entry = tree.get(child.tag)
            if entry is None:
                self._unknown(child, tuple(tree), key)
            elif isinstance(entry, dict):
                self._block(child, entry, cells, axis, f"{key}.{child.tag}")
            else:
                self._leaf(child, cells.values[entry], cells.lines[entry], axis, key)

    def _leaf(self, leaf: Any, values: FloatArray, lines: IntArray, axis: int, key: str) -> None:
        text, line = leaf.text or "", leaf.sourceline
        if not np.isnan(values[axis]):
            what = f"given before, on line {lines[axis]}"
            self._refuse(what, line, f"{key}.{leaf.tag}")
        elif len(leaf) or not _NUMBER.fullmatch(text):
            what = f"must be a number (value {text[:_SHOWN]!r})"
            self._refuse(what, line, f"{key}.{leaf.tag}")
        values[axis], lines[axis] = _number(text), line

    def _columns(
        self, cells: _Cells, missing: dict[str, tuple[int, ...]]
    ) -> list[tuple[Parameter, Column]]:
        columns: list[tuple[Parameter, Column]] = []
        for row, (section, item) in enumerate(cells.items):
            values, lines = cells.values[row], cells.lines[row]
            absent = np.isnan(values)
            if absent.any():
                axes = tuple(np.flatnonzero(absent).tolist())
                missing[item.name] = axes if cells is self._axes else ()
            column = np.where(absent, item.default, values)
            for axis, text in column_problems(item, column):
                block = f"axis{axis}" if cells is self._axes else "GlobalParameters"
                key = f"{block}.{section}.{item.name.replace('/', '.')}"
                self._refuse(text, int(lines[axis]), key)
                column[axis] = item.default
            columns.append((item, checked_column(item, column)))
        return columns

    def _check_gears(self, columns: list[tuple[Parameter, Column]]) -> None:
        row = [item.name for item, _ in columns].index("AxisGearRatioNumerator")
        for axis, text in gear_problems(dict(_named(columns))):
            self._refuse(text, int(self._axes.lines[row, axis]), f"axis{axis}.AxisParam")
        if self._problems:
            raise DescriptorError.join(self._problems)

    def _unknown(self, element: Any, known: tuple[str, ...], key: str) -> None:
        tag = element.tag if isinstance(element.tag, str) else str(element)
        what = f"unknown element <{tag[:_SHOWN]}>{did_you_mean(tag, known)}"
        self._refuse(what, element.sourceline, key)

    def _refuse(self, what: str, line: int, key: str) -> None:
        self._problems.append(DescriptorError(what, path=self._path, line=line or None, key=key))
        if len(self._problems) == _MAX_PROBLEMS:
            raise DescriptorError.join(self._problems)


def _named(columns: list[tuple[Parameter, Column]]) -> Iterator[tuple[str, Column]]:
    return ((item.name, column) for item, column in columns)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0  # the caller has rejected it already


def _parse(path: Path, data: bytes) -> Any:
    if (count := data.count(b"<") + data.count(b"=")) > MAX_MARKUP:
        what = f"{count:_} tags and attributes, the limit is {MAX_MARKUP:_}"
        raise DescriptorError(what, path=path)
    parser = etree.XMLParser(
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        what = f"not valid XML: {error.msg}"
        raise DescriptorError(what, path=path, line=error.lineno or None) from None
    docinfo: Any = root.getroottree().docinfo
    if docinfo.doctype:
        raise DescriptorError("a DOCTYPE is not allowed", path=path, line=1)
    return root


def write_wmx_parameters(parameters: WmxParameters, path: Path) -> None:
    """Write a complete file, LF and tabs, as the engine does. Raises OSError."""
    root = etree.Element("Parameters", ver=VERSION)
    block = etree.SubElement(root, "GlobalParameters")
    _fill(block, GLOBAL_SECTIONS, parameters.global_values)
    for axis in range(N_AXES):
        block = etree.SubElement(root, "AxisParameters", Axis=str(axis))
        _fill(block, AXIS_SECTIONS, parameters.axis(axis))
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n{_indented(root)}\n'
    path.write_text(text, encoding="utf-8", newline="\n")


def axis_text(parameters: WmxParameters, axis: int) -> str:
    """Return one axis as XML text, in the layout of the file."""
    block = etree.Element("AxisParameters", Axis=str(axis))
    _fill(block, AXIS_SECTIONS, parameters.axis(axis))
    return _indented(block)


def _indented(root: Any) -> str:
    etree.indent(root, space="\t")
    return etree.tostring(root, encoding="unicode")


def _fill(block: Any, sections: Sections, values: Mapping[str, Scalar]) -> None:
    for section, items in sections.items():
        groups: dict[tuple[str, ...], Any] = {
            (): etree.SubElement(block, section)
        }  # path below the section → element
        for item in items:
            *tags, leaf = item.name.split("/")
            parent = groups[()]
            for depth, tag in enumerate(tags, start=1):
                path = tuple(tags[:depth])
                if path not in groups:
                    groups[path] = etree.SubElement(parent, tag)
                parent = groups[path]
            etree.SubElement(parent, leaf).text = _text(item, values[item.name])


def _text(item: Parameter, value: Scalar) -> str:
    """Format with six decimals, or as many as reading back unchanged needs."""
    if item.kind is not Kind.REAL:
        return str(int(value))
    text = f"{value:.6f}"
    return text if float(text) == value else repr(float(value))
