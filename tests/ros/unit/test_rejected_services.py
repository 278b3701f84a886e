"""Every response has the reason of a rejection, wherever its type keeps it."""

from __future__ import annotations

from typing import Any

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from std_srvs.srv import Trigger

from robotd.errors import NotReady
from robotd_ros.services import _answer


@pytest.mark.parametrize("error", [NotReady("joint1: servo is off"), OverflowError("too large")])
@pytest.mark.parametrize("service_type", [Trigger, SetParametersAtomically])
def test_the_reason_of_a_rejection_is_answered(service_type: Any, error: Exception) -> None:
    def handler(request: Any, response: Any) -> Any:
        raise error

    response = _answer(service_type, "any", handler, service_type.Request())
    if service_type is Trigger:
        assert (response.success, str(error) in response.message) == (False, True)
    else:
        assert (response.result.successful, str(error) in response.result.reason) == (False, True)
