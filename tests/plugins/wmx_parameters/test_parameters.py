import numpy as np
import pytest

from robotd.errors import DescriptorError
from robotd_wmx_parameters import default_wmx_parameters
from robotd_wmx_parameters.element_table import Kind
from robotd_wmx_parameters.parameters import AXIS_PARAMETERS, GLOBAL_PARAMETERS

DEFAULTS = default_wmx_parameters()


def test_every_column_has_its_type_and_is_read_only() -> None:
    kinds = {Kind.REAL: np.float64, Kind.FLAG: np.bool_}
    for name, item in AXIS_PARAMETERS.items():
        column = DEFAULTS[name]
        assert column.shape == (128,)
        assert column.dtype == kinds.get(item.kind, np.int64)
        assert np.all(column == item.default)
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0


def test_every_default_is_inside_its_range() -> None:
    for item in [*AXIS_PARAMETERS.values(), *GLOBAL_PARAMETERS.values()]:
        assert item.low <= item.default <= item.high, item.name


def test_an_axis_is_plain_python() -> None:
    axis = DEFAULTS.axis(5)
    assert axis["AxisPolarity"] == 1
    assert axis["AbsoluteEncoderMode"] is False
    assert isinstance(axis["InPosWidth"], float)
    assert DEFAULTS.global_values["EnableFlightRecorder"] is True


def test_changed_values() -> None:
    changed = DEFAULTS.with_values({"AxisPolarity": {2: -1}, "InPosWidth": {0: 0.5, 1: 0.25}})
    assert changed["AxisPolarity"][2] == -1
    assert list(changed["InPosWidth"][:3]) == [0.5, 0.25, 1000]
    assert DEFAULTS["AxisPolarity"][2] == 1


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("AxisPolarity", 0, r"AxisPolarity of axis 7 must be 1 or -1 \(value 0\)"),
        ("PauseMode", 2, r"PauseMode of axis 7 must be 0 or 1 \(value 2\)"),
        ("HomeType", 21, r"a whole number of HomeType from 0 to 20 \(value 21\)"),
        ("MultipleZPulse", 1.5, r"a whole number from 0 to 100 \(value 1.5\)"),
        ("InPosWidth", -1, r"a number from 0 to 274877906943 uu \(value -1\)"),
        ("InPosWidth", float("nan"), r"value nan"),
        ("AxisGearRatioDenominator", 1e9, r"gear ratio of axis 7 must be 1e-06 to 2147483647"),
    ],
)
def test_values_out_of_range(name: str, value: float, message: str) -> None:
    with pytest.raises(DescriptorError, match=message):
        DEFAULTS.with_values({name: {7: value}})


def test_an_unknown_name() -> None:
    with pytest.raises(KeyError, match="did you mean 'AxisPolarity'"):
        DEFAULTS["AxisPolarty"]
