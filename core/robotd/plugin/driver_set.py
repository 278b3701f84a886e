"""Drivers of one device, and the check that declared features have their methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from robotd.device.capabilities import Capability
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.device.passive_joints import DrivenFingers, PassiveJoints
from robotd.device.payload import PayloadDriver
from robotd.device.profiled_axes import ProfiledAxes
from robotd.device.world import World
from robotd.device.wrench import WrenchDriver
from robotd.plugin.driver_signatures import signature_problems
from robotd.plugin.fault_isolation import isolated

_METHODS: dict[Capability, tuple[tuple[type, str], ...]] = {
    Capability.VELOCITY_MODE: ((AxisDriver, "jog"), (AxisDriver, "set_command_mode")),
    Capability.TORQUE_MODE: ((AxisDriver, "set_command_mode"), (AxisDriver, "stream_torque")),
    Capability.HAND_GUIDING: ((AxisDriver, "begin_guiding"),),
    Capability.HOMING: ((AxisDriver, "home"),),
    Capability.SCALING: ((AxisDriver, "set_polarity"), (AxisDriver, "set_gear_ratio")),
    Capability.TRAJECTORIES_ON_DEVICE: ((AxisDriver, "follow"),),
    Capability.PARAMETERS_FILE: (
        (DeviceDriver, "load_parameters"),
        (DeviceDriver, "dump_parameters"),
    ),
    Capability.REGISTER_READ: ((FieldbusDriver, "read_register"),),
    Capability.STATISTICS: ((FieldbusDriver, "reset_statistics"),),
    Capability.HOT_CONNECT: ((FieldbusDriver, "start_hot_connect"),),
    Capability.OBJECTS: ((FieldbusDriver, "read_object"), (FieldbusDriver, "write_object")),
}
"""Methods that a declared capability needs; without the capability they are never called."""

_STREAMING = tuple((AxisDriver, name) for name in ("begin_stream", "stream", "end_stream"))


@dataclass(frozen=True)
class Drivers:
    """Drivers that a backend made for one device.

    Attributes:
        device, axes: always there.
        io, fieldbus: None where this robot has none.
        make_fault_injector: makes the fault injector of this device, or None.
        passive_joints, world, payload, wrenches: None where there are none.
    """

    device: DeviceDriver
    axes: AxisDriver
    io: IoDriver | None
    fieldbus: FieldbusDriver | None
    make_fault_injector: Callable[[], FaultInjector | None]
    passive_joints: PassiveJoints | None = None
    world: World | None = None
    payload: PayloadDriver | None = None
    wrenches: WrenchDriver | None = None

    def capabilities(self, declared: frozenset[Capability]) -> frozenset[Capability]:
        """Return the declared capabilities and those that follow from the drivers."""
        derived = {Capability.AXES}
        derived |= {Capability.IO} if self.io is not None else set()
        derived |= {Capability.FIELDBUS} if self.fieldbus is not None else set()
        derived |= {Capability.PAYLOAD} if self.payload is not None else set()
        return declared - set(self.axes.lacking) | derived

    def missing(self, declared: frozenset[Capability]) -> list[str]:
        """Return what the declared capabilities need and the drivers lack, as texts."""
        found = [
            f"'{capability}' is declared, but {self._text(contract, name)}"
            for capability in sorted(declared & _METHODS.keys())
            for contract, name in _METHODS[capability]
            if not self._has(contract, name)
        ]
        if Capability.TRAJECTORIES_ON_DEVICE not in declared:
            found += [
                f"'{Capability.TRAJECTORIES_ON_DEVICE}' is not declared, so setpoints are"
                f" streamed, but {self._text(contract, name)}"
                for contract, name in _STREAMING
                if not self._has(contract, name)
            ]
        return found

    def undeclared(self, declared: frozenset[Capability]) -> list[str]:
        """Return capabilities whose methods are there although they are not declared."""
        return [
            str(capability)
            for capability, methods in _METHODS.items()
            if capability not in declared
            and all(self._has(contract, name) for contract, name in methods)
        ]

    def signature_problems(self) -> list[str]:
        """Return a line for each method that takes other arguments than those of its contract."""
        made: tuple[tuple[object | None, type], ...] = (
            (self.device, DeviceDriver),
            (self.axes, AxisDriver),
            (self.io, IoDriver),
            (self.fieldbus, FieldbusDriver),
            (self.passive_joints, self._joints_contract),
            (self.world, World),
            (self.payload, PayloadDriver),
            (self.wrenches, WrenchDriver),
            (self.make_fault_injector(), FaultInjector),
        )
        return [
            line
            for driver, contract in made
            if driver is not None
            for line in signature_problems(getattr(driver, "wrapped", driver), contract)
        ]

    def isolated(self, plugin: str, backend: str) -> Drivers:
        """Return the same drivers behind fault isolation; see ``fault_isolation.isolated``."""
        return replace(
            self,
            device=isolated(self.device, DeviceDriver, plugin, backend),
            axes=isolated(self.axes, AxisDriver, plugin, backend),
            io=self.io and isolated(self.io, IoDriver, plugin, backend),
            fieldbus=self.fieldbus and isolated(self.fieldbus, FieldbusDriver, plugin, backend),
            passive_joints=self.passive_joints
            and isolated(self.passive_joints, self._joints_contract, plugin, backend),
            world=self.world and isolated(self.world, World, plugin, backend),
            payload=self.payload and isolated(self.payload, PayloadDriver, plugin, backend),
            wrenches=self.wrenches and isolated(self.wrenches, WrenchDriver, plugin, backend),
        )

    @property
    def _joints_contract(self) -> type[PassiveJoints]:
        return DrivenFingers if isinstance(self.passive_joints, DrivenFingers) else PassiveJoints

    def _driver(self, contract: type) -> object | None:
        drivers = (self.device, self.axes, self.io, self.fieldbus)
        driver = next((driver for driver in drivers if isinstance(driver, contract)), None)
        return getattr(driver, "wrapped", driver)  # an isolated driver has every method

    def _has(self, contract: type, name: str) -> bool:
        driver = self._driver(contract)
        contract, name = _of_backend(driver, contract, name)
        return driver is not None and getattr(type(driver), name) is not getattr(contract, name)

    def _text(self, contract: type, name: str) -> str:
        driver = self._driver(contract)
        if driver is None:
            return f"there is no {contract.__name__} for {name}()"
        return f"{type(driver).__name__} has no method {_of_backend(driver, contract, name)[1]}()"


def _of_backend(driver: object, contract: type, name: str) -> tuple[type, str]:
    """Return the method that a backend writes where ``name`` of the contract is needed."""
    if name == "begin_guiding" and isinstance(driver, ProfiledAxes):
        return ProfiledAxes, "let_go"
    return contract, name
