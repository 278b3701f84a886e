"""Clauses of the conformance kit: they are the driver contract, whole, and checks bear them."""

from __future__ import annotations

import inspect
import re
from functools import cache
from importlib import import_module
from types import FunctionType

import pytest
from tests.features.conformance.runs.kit import CHECKS
from tests.features.conformance.runs.measured_faults import checks_of
from tests.features.conformance.runs.mutants import all_mutants

from robotd.device import drivers
from robotd.device.fault_injector import FaultInjector
from robotd.device.payload import PayloadDriver
from robotd.device.process_image import ProcessImage
from robotd.device.wrench import WrenchDriver
from robotd_conformance.checks import aspects
from robotd_conformance.checks import clauses as kit

CLAUSES, FAULTS, NOTES = kit.load()
OPEN_CELLS = 152  # of 2280
CONTRACTS = (
    drivers.DeviceDriver,
    drivers.AxisDriver,
    drivers.IoDriver,
    drivers.FieldbusDriver,
    PayloadDriver,
    WrenchDriver,
    FaultInjector,
)


def docstrings() -> dict[str, str]:
    """Return the texts of the contract by member, in one line each."""
    found = {"drivers": drivers.__doc__}
    for contract in CONTRACTS:
        found[contract.__name__] = contract.__doc__
        for name, member in vars(contract).items():
            described = isinstance(member, FunctionType | property)
            if described and not name.startswith("_") and (text := inspect.getdoc(member)):
                found[f"{contract.__name__}.{name}"] = text
    found["AxisDriver.read"] += f" {ProcessImage.__doc__}"  # what it fills
    return {name: re.sub(r"\s+", " ", text or "") for name, text in found.items()}


@cache
def checks() -> dict[str, set[str]]:
    """Return the clauses that each check bears."""
    found = {}
    for path in sorted(CHECKS.glob("test_*.py")):
        module = import_module(f"{kit.__name__.rpartition('.')[0]}.{path.stem}")
        for name, check in vars(module).items():
            own = isinstance(check, FunctionType) and check.__module__ == module.__name__
            if own and name.startswith("test_"):
                marks = [
                    mark for mark in vars(check).get("pytestmark", ()) if mark.name == "clause"
                ]
                found[f"{path.name}::{name}"] = {clause for mark in marks for clause in mark.args}
    return found


def test_each_clause_is_in_the_contract() -> None:
    texts = docstrings()
    absent = [
        clause.id
        for clause in CLAUSES.values()
        if clause.member != "backend" and clause.says not in texts[clause.member]
    ]
    assert absent == [], "their texts are not in the docstrings"


def test_each_sentence_of_the_contract_is_a_clause() -> None:
    missing = []
    for member, text in docstrings().items():
        said = [clause.says for clause in CLAUSES.values() if clause.member == member] + NOTES
        for sentence in filter(None, re.split(r"(?<=\.)\s+", text)):
            known = any(sentence in text or text in sentence for text in said)
            missing += [] if known else [f"{member}: {sentence}"]
    assert missing == [], "add clauses, or notes where nothing is asked of a driver"


def test_each_check_bears_a_clause() -> None:
    for check, borne in checks().items():
        assert borne, f"{check} names no clause"
        assert borne <= set(CLAUSES), f"{check}: {borne - set(CLAUSES)} do not exist"


@pytest.mark.parametrize("mutant", all_mutants().values(), ids=lambda mutant: mutant.__name__)
def test_each_mutant_breaks_a_clause_that_its_check_bears(mutant: type) -> None:
    clause, fault = mutant.breaks  # type: ignore[attr-defined]
    assert fault in CLAUSES[clause].faults, f"add {fault!r} to the faults of {clause}"
    found_by = mutant.found_by  # type: ignore[attr-defined]
    names = (found_by,) if isinstance(found_by, str) else found_by
    borne = checks()
    for name in filter(None, names):
        assert clause in borne[name], f"{name} does not bear {clause}"


def test_the_faults_have_texts() -> None:
    used = {fault for clause in CLAUSES.values() for fault in clause.faults}
    assert used == set(FAULTS)


def cells_of_aspects() -> dict[str, dict[str, str]]:
    mutants = all_mutants().values()
    found = [(*mutant.breaks, checks_of(mutant)) for mutant in mutants]
    bearing: dict[str, list[str]] = {}
    for check, borne in checks().items():
        for clause in borne:
            bearing.setdefault(clause, []).append(check)
    return aspects.cells(found, bearing)


def test_no_cell_of_the_aspects_opens() -> None:
    """A clause has a check for each aspect, or a reason; what has neither becomes less."""
    cells = [cell for row in cells_of_aspects().values() for cell in row.values()]
    assert cells.count(aspects.OPEN) <= OPEN_CELLS


def test_the_aspects_name_what_there_is() -> None:
    table, reasons = aspects.load()
    themes = {path.stem.removeprefix("test_") for path in CHECKS.glob("test_*.py")}
    for name, aspect in table.items():
        assert set(aspect.faults) <= set(FAULTS), name
        assert set(aspect.themes) <= themes, f"{name}: {set(aspect.themes) - themes}"
        assert set(aspect.without) <= set(reasons), name
        for begin in (begin for begins in aspect.without.values() for begin in begins):
            assert any(clause.startswith(begin) for clause in CLAUSES), f"{name}: {begin}"
    assert {fault for aspect in table.values() for fault in aspect.faults} == set(FAULTS)
