"""What the commands for one servo share: whose servo it is."""

from __future__ import annotations

import pytest

from motorbus.cli.feetech.servo import one_of_ours, reads_only
from motorbus.errors import RequestError


def test_one_servo_of_this_family() -> None:
    assert one_of_ours("feetech:sim#3").nodes == (3,)
    for text in ("feetech:sim", "feetech:sim#1-2", "kst:sim#3", "feetech:sim#254"):
        with pytest.raises(RequestError):
            one_of_ours(text)


def test_a_dry_run_of_what_only_reads() -> None:
    reads_only(False)
    with pytest.raises(RequestError, match="only reads"):
        reads_only(True)
