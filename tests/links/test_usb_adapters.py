"""What is known of adapters, and the latency timer as the kernel tells it."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.link.usb_adapters import ADAPTERS, PortInfo, device_latency, guess, latency_timer


def timer_file(sysfs: Path, name: str) -> Path:
    folder = sysfs / "class" / "tty" / name / "device"
    folder.mkdir(parents=True)
    return folder / "latency_timer"


def test_every_adapter_has_a_chip_and_a_source() -> None:
    assert len(ADAPTERS) >= 10
    assert [ids for ids, adapter in ADAPTERS.items() if not (adapter.chip and adapter.source)] == []


@pytest.mark.parametrize(
    ("ids", "text"),
    [
        ((0x1A86, 0x55D3), "CH343: usual on FEETECH and Waveshare servo boards"),
        ((0x1A86, 0x7523), "CH340"),
        ((0x0403, 0x6001), "latency timer"),
        ((0x0483, 0x5740), "STM32"),
        ((0x1A86, 0x7522), "CH340K"),
    ],
)
def test_the_usual_adapters_are_known(ids: tuple[int, int], text: str) -> None:
    assert text in guess(*ids)


@pytest.mark.parametrize("ids", [(0xDEAD, 0xBEEF), (None, None), (0x1A86, None)])
def test_unknown_adapters(ids: tuple[int | None, int | None]) -> None:
    assert guess(*ids) == ""


def test_the_description() -> None:
    port = PortInfo("/dev/ttyACM0", "", None, None, "", "QinHeng", "USB Single Serial", "")
    assert port.description == "QinHeng USB Single Serial"
    assert port._replace(manufacturer="").description == "USB Single Serial"


def test_the_latency_timer_is_read(tmp_path: Path) -> None:
    timer_file(tmp_path, "ttyUSB0").write_text("16\n")
    assert latency_timer("/dev/ttyUSB0", tmp_path) == 16
    assert latency_timer("/dev/ttyUSB1", tmp_path) is None


def test_an_unreadable_timer(tmp_path: Path) -> None:
    timer_file(tmp_path, "ttyUSB0").write_text("fast\n")
    assert latency_timer("/dev/ttyUSB0", tmp_path) is None


def test_a_slow_timer_is_warned_about_with_the_remedy(tmp_path: Path) -> None:
    timer_file(tmp_path, "ttyUSB0").write_text("16\n")
    latency, [warning] = device_latency("/dev/ttyUSB0", tmp_path)
    assert latency == pytest.approx(0.019)
    assert "16 ms" in warning
    assert "58 reads a second" in warning
    assert "echo 1 > /sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in warning
    assert 'DRIVER=="ftdi_sio", ATTR{latency_timer}="1"' in warning
