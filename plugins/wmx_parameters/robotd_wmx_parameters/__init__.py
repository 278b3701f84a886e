"""WMX parameter files: their elements, values and XML layout.

A library, no backend: the simulation and the WMX backend read the same files. Values keep the
units of the vendor; the backends convert them.
"""

from robotd_wmx_parameters.advice import parameter_warnings
from robotd_wmx_parameters.parameters import (
    WmxParameters,
    default_wmx_parameters,
    require_same_scaling,
)
from robotd_wmx_parameters.xml_file import axis_text, read_wmx_parameters, write_wmx_parameters

__all__ = [
    "WmxParameters",
    "axis_text",
    "default_wmx_parameters",
    "parameter_warnings",
    "read_wmx_parameters",
    "require_same_scaling",
    "write_wmx_parameters",
]
