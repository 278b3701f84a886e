"""The simulated drive's dictionary and the EDS file of CANopen describe one drive."""

from __future__ import annotations

from canopen.objectdictionary.datatypes import SIGNED_TYPES

from robotd_canopen.object_dictionary import GENERIC_DRIVE, eds_path, read_eds, variable
from robotd_cia402.simulated import DRIVE_OBJECTS, drive_defaults


def test_objects_are_those_of_the_generic_eds() -> None:
    dictionary = read_eds(eds_path(None, None, GENERIC_DRIVE), 1)
    for entry in DRIVE_OBJECTS:
        found = variable(dictionary, entry.index, entry.sub)
        assert found is not None, entry
        assert found.name == entry.name
        assert (len(found), found.data_type in SIGNED_TYPES) == entry.kind
        assert (found.default, found.writable) == (entry.default, entry.writable)


def test_each_axis_has_the_objects_0x800_further() -> None:
    defaults = drive_defaults(axes=2)
    assert len(defaults) == 2 * len(DRIVE_OBJECTS)
    assert defaults[0x6085 + 0x800, 0] == defaults[0x6085, 0] == 5_000_000
