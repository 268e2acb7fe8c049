"""The net: tests that must pass unchanged before and after the engine is exchanged. README.md has a table of them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
NET: Final = (
    "tests/bus/test_engine.py",
    "tests/bus/test_engine_model.py",
    "tests/cli/test_cli.py",
    "tests/cli/test_every_command.py",
    "tests/conformance",
    "tests/contract",
    "tests/docs",
    "tests/faults/test_kst_single_faults.py",
    "tests/faults/test_single_faults.py",
    "tests/faults/test_stepper_single_faults.py",
    "tests/golden",
    "tests/interop",
    "tests/protocol/feetech/test_wire_vectors.py",
    "tests/protocol/kst",
    "tests/protocol/stepper/test_execution.py",
    "tests/protocol/stepper/test_protocol.py",
    "tests/safety/test_gate_property.py",
    "tests/safety/test_kill.py",
    "tests/safety/test_promises.py",
    "tests/safety/test_promises_from_9.py",
    "tests/safety/test_repeated_orders.py",
    "tests/safety/test_signals.py",
    "tests/simulators",
)
"""Folders and files; one that does not exist yet is skipped."""
ADAPTERS: Final = ("tests/support/world.py", "tests/bus/adapter.py")
"""The only files that may name the engine; they are edited together with it."""
