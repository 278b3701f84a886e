"""The drivers behind a robot, which keeps them to itself."""

from __future__ import annotations

from robotd.descriptor import RobotDescriptor
from robotd.device.drivers import AxisDriver, DeviceDriver, FieldbusDriver, IoDriver
from robotd.device.fault_injector import FaultInjector
from robotd.plugin.hookspecs import BackendInfo, BackendOptions, DeviceContext
from robotd.plugin.manager import Backend


class Parts:
    """A backend that remembers the drivers it made."""

    def __init__(self, backend: Backend) -> None:
        self.info: BackendInfo = backend.info
        self.device: DeviceDriver
        self.driver: AxisDriver
        self.io_driver: IoDriver | None = None
        self.fieldbus_driver: FieldbusDriver | None = None
        self.made_bench: FaultInjector | None = None
        self._backend = backend

    def options(self, robot: RobotDescriptor) -> BackendOptions:
        return self._backend.options(robot)

    def open_device(self, context: DeviceContext) -> DeviceDriver:
        self.device = self._backend.open_device(context)
        self.made_bench = self._backend.fault_injector(self.device, context)
        return self.device

    def fault_injector(self, device: DeviceDriver, context: DeviceContext) -> FaultInjector | None:
        return self.made_bench

    def axes(self, device: DeviceDriver, context: DeviceContext) -> AxisDriver:
        self.driver = self._backend.axes(device, context)
        return self.driver

    def io(self, device: DeviceDriver, context: DeviceContext) -> IoDriver | None:
        self.io_driver = self._backend.io(device, context)
        return self.io_driver

    def fieldbus(self, device: DeviceDriver, context: DeviceContext) -> FieldbusDriver | None:
        self.fieldbus_driver = self._backend.fieldbus(device, context)
        return self.fieldbus_driver
