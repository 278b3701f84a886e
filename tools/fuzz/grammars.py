"""Texts from nothing: random trees of the words that a reader knows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from pydantic import BaseModel
from tools.fuzz.mutations import NUMBERS

from robotd.descriptor import RobotDescriptor
from robotd_scenario import FAULTS
from robotd_scenario.program import Check, Scenario, ScenarioStep
from robotd_wmx_parameters.element_table import AXIS_SECTIONS, GLOBAL_SECTIONS

DEPTH = 5


def robot(random: Random) -> str:
    return "schema: 1\nname: x\naxes: 6\n" + _yaml(random, _keys(RobotDescriptor))


def scenario(random: Random) -> str:
    keys = [
        *_keys(Scenario),
        *_keys(ScenarioStep),
        *_keys(Check),
        *FAULTS,
        "axis",
        "at_s",
        "for_s",
        "when",
    ]
    return "schema: 1\n" + _yaml(random, keys)


def parameters(random: Random) -> str:
    tags = list(
        {
            tag
            for sections in (AXIS_SECTIONS, GLOBAL_SECTIONS)
            for section, items in sections.items()
            for tag in (section, *(part for item in items for part in item.name.split("/")))
        }
    )
    tags.sort()

    def leaf() -> str:
        section, items = random.choice(list(AXIS_SECTIONS.items()))
        tag = random.choice(items).name.split("/")[-1]
        return f"<{section}><{tag}>{_number(random)}</{tag}></{section}>"

    blocks = (
        f'<AxisParameters Axis="{random.choice(("0", "127", *NUMBERS))}">'
        f"{''.join(leaf() for _ in range(random.randrange(5)))}"
        f"{_xml(random, tags) if random.random() < 0.3 else ''}</AxisParameters>"
        for _ in range(random.randrange(4))
    )
    return f"<Parameters>{''.join(blocks)}</Parameters>"


def urdf(random: Random) -> str:
    tags = ("robot", "joint", "limit", "link", "mimic")
    joints = (
        f'<joint name="joint{number}" type="{random.choice(("revolute", "fixed", ""))}">'
        f'<limit lower="{_number(random)}" upper="{_number(random)}" velocity="{_number(random)}"/>'
        f"</joint>"
        for number in range(random.randrange(8))
    )
    return f"<robot>{''.join(joints)}{_xml(random, tags)}</robot>"


def eds(random: Random) -> str:
    def section() -> Iterator[str]:
        index = random.choice(("1000", "6040", "1A00", "DeviceInfo", "DummyUsage", "6040Name"))
        yield f"[{index}{random.choice(('', '', 'sub0', 'sub1', 'subFFFFFF'))}]"
        for key in random.sample(_EDS_KEYS, random.randrange(len(_EDS_KEYS))):
            yield f"{key}={random.choice(('0x7', '0x8', '0x9', '0x0005', 'rw', _number(random)))}"

    return "\n".join(line for _ in range(random.randrange(6)) for line in section())


def esi(random: Random) -> str:
    def pdo() -> str:
        tag = random.choice(("RxPdo", "TxPdo"))
        index = random.choice(("#x6040", "#x6041", "#x607A", "#x0", _number(random)))
        entry = f"<Entry><Index>{index}</Index><BitLen>{_number(random)}</BitLen></Entry>"
        number = random.choice(("#x1600", "#x1A00", _number(random)))
        excluded = f"<Exclude>{_number(random)}</Exclude>"
        return (
            f'<{tag} Sm="2"><Index>{number}</Index>{excluded}{entry * random.randrange(4)}</{tag}>'
        )

    tags = ("Device", "Module", "RxPdo", "Entry", "Slots", "Slot", "Dc", "OpMode", "Name", "Type")
    devices = (
        f'<Device><Type ProductCode="{_number(random)}">x</Type>'
        f"{''.join(pdo() for _ in range(random.randrange(5)))}{_xml(random, tags)}"
        f'<Slots SlotPdoIncrement="{_number(random)}"><Slot MaxInstances="{_number(random)}">'
        f"<ModuleIdent>1</ModuleIdent></Slot></Slots></Device>"
        for _ in range(random.randrange(3))
    )
    module = f'<Module><Type ModuleIdent="1"/>{pdo()}{_xml(random, tags)}</Module>'
    return (
        f"<EtherCATInfo><Vendor><Id>{_number(random)}</Id></Vendor><Descriptions><Devices>"
        f"{''.join(devices)}</Devices><Modules>{module}</Modules></Descriptions></EtherCATInfo>"
    )


def words(random: Random) -> str:
    keys = ["axis", "code", "at_s", "for_s", "when.joint", "when.above_rad", "when", "when.", ""]
    settings = [
        f"{random.choice(keys)}={random.choice(('true', 'x', _number(random)))}"
        for _ in range(random.randint(1, 4))
    ]
    return "\n".join([random.choice(FAULTS), *settings])


_EDS_KEYS = [
    *("ParameterName", "ObjectType", "DataType", "AccessType", "PDOMapping", "DefaultValue"),
    *("LowLimit", "HighLimit", "SubNumber", "CompactSubObj", "NrOfEntries", "StorageLocation"),
    *("Factor", "ParameterValue", "Dummy0001", "BaudRate_250", "NrOfRXPDO", "1", "2"),
]


def _keys(model: type[BaseModel]) -> list[str]:
    """Every key that ``model`` and the models in it know, in the order that they are met."""
    found: dict[str, None] = {}

    def visit(schema: Any) -> None:
        if isinstance(schema, dict):
            found.update(dict.fromkeys(schema.get("properties", {})))
            schema = list(schema.values())
        for item in schema if isinstance(schema, list) else ():
            visit(item)

    visit(model.model_json_schema())
    return list(found)


def _number(random: Random) -> str:
    if random.random() < 0.5:
        return random.choice(("0", "1", "2", "-1", "0.5", "100"))
    return random.choice(NUMBERS)


def _tree(random: Random, depth: int, leaf: Callable[[], str], many: Callable[..., str]) -> str:
    if depth == 0 or random.random() < 0.3:
        return leaf()
    return many(_tree(random, depth - 1, leaf, many) for _ in range(random.randrange(5)))


def _yaml(random: Random, keys: list[str]) -> str:
    """A mapping in flow style, lists and mappings in each other."""

    def leaf() -> str:
        return random.choice((random.choice(keys), _number(random), "null", "true", "''", "on"))

    def many(items: Iterator[str]) -> str:
        if random.random() < 0.3:
            return f"[{', '.join(items)}]"
        return "{" + ", ".join(f"{random.choice(keys)}: {item}" for item in items) + "}"

    chosen = random.sample(keys, min(len(keys), random.randrange(8)))
    return "".join(f"{key}: {_tree(random, DEPTH, leaf, many)}\n" for key in chosen)


def _xml(random: Random, tags: Any) -> str:
    def many(items: Iterator[str]) -> str:
        tag = random.choice(tags)
        return f"<{tag}>{''.join(items)}</{tag}>"

    return _tree(random, DEPTH, lambda: f"<{random.choice(tags)}/>", many)
