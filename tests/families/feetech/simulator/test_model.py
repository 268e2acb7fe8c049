"""Models by name."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.model import MODELS, model


def test_the_usual_model_and_the_same_in_capitals() -> None:
    assert model("") is model("STS3215") is MODELS["sts3215"]


def test_an_unknown_model_is_refused_with_those_there_are() -> None:
    with pytest.raises(RequestError) as caught:
        model("sts9999")
    assert "sts3215" in caught.value.expected
