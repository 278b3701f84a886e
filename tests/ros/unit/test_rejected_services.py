"""Every response has the reason of a rejection, wherever its type keeps it."""

from __future__ import annotations

from typing import Any

import pytest
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from std_srvs.srv import Trigger

from robotd.errors import NotReady
from robotd_ros.failed_requests import MAX_ANSWER_CHARACTERS, rejection

ERRORS = [NotReady("joint1: servo is off"), OverflowError("too large")]


@pytest.mark.parametrize("error", ERRORS)
def test_the_reason_of_a_rejection_is_answered(error: Exception) -> None:
    trigger = rejection(Trigger, Trigger.Request(), error)
    assert (trigger.success, str(error) in trigger.message) == (False, True)
    whole = rejection(SetParametersAtomically, SetParametersAtomically.Request(), error).result
    assert (whole.successful, str(error) in whole.reason) == (False, True)
    request = SetParameters.Request(parameters=[Parameter(), Parameter()])
    results = rejection(SetParameters, request, error).results
    assert [(result.successful, str(error) in result.reason) for result in results] == [
        (False, True)
    ] * 2


def test_a_response_without_a_field_for_the_reason_is_empty() -> None:
    assert rejection(GetParameters, GetParameters.Request(), ERRORS[0]).values == []


@pytest.mark.parametrize("kind", [Trigger, SetParametersAtomically])
def test_a_long_reason_is_cut(kind: Any) -> None:
    response = rejection(kind, kind.Request(), NotReady("x" * 200_000))
    text = response.message if kind is Trigger else response.result.reason
    assert len(text) < MAX_ANSWER_CHARACTERS + 100
