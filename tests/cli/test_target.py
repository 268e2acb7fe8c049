"""From words to buses and devices; what can be refused is refused before a port is opened."""

from __future__ import annotations

import pytest

import motorbus
from motorbus import families
from motorbus.cli import target
from motorbus.cli.output import Output
from motorbus.errors import RequestError
from motorbus.families.feetech import FAMILY
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench


def test_a_bus_and_its_nodes() -> None:
    found = target.target("feetech:/dev/ttyACM0,baud=500000#1-3+7")
    assert found.bus == "feetech:/dev/ttyACM0,baud=500000"
    assert found.family.name == "feetech"
    assert found.nodes == (1, 2, 3, 7)


@pytest.mark.parametrize("text", ["feetech:COM7", "feetech:COM7#1+2"])
def test_exactly_one_device_means_one(text: str) -> None:
    with pytest.raises(RequestError, match="exactly one device"):
        target.device(text)


@pytest.mark.parametrize(
    "text", ["feetech", "nobody:COM7", "feetech:COM7#254", "feetech:COM7#0-254", "feetech:COM7#"]
)
def test_what_is_no_target_is_refused_without_a_port(text: str) -> None:
    with pytest.raises(RequestError):
        target.target(text)


def test_the_only_device_of_a_line_needs_no_name() -> None:
    assert target.target("stepper:COM7").nodes == (1,)
    assert target.device("stepper:COM7,motor=5") == target.device("stepper:COM7,motor=5#1")
    assert target.gathered(["stepper:COM7", "stepper:COM8#1"]) == {"stepper:COM7": (1,), "stepper:COM8": (1,)}
    with pytest.raises(RequestError, match="is not the id of a stepper controller"):
        target.target("stepper:COM7#2")


def test_targets_are_gathered_by_bus_each_node_once() -> None:
    found = target.gathered(["feetech:COM7#1+2", "feetech:COM8", "feetech:COM7#2+3"])
    assert found == {"feetech:COM7": (1, 2, 3), "feetech:COM8": ()}


def test_no_target_at_all_is_refused() -> None:
    with pytest.raises(RequestError, match="which bus"):
        target.gathered([])


def test_a_register_that_no_map_has_is_refused_with_a_suggestion() -> None:
    target.check_names(FAMILY, ["present_position"])
    with pytest.raises(RequestError, match="perhaps present_position"):
        target.check_names(FAMILY, ["present_positon"])


def test_a_verb_that_a_device_lacks_is_named() -> None:
    class Box:
        node = 1

        class bus:  # noqa: N801
            family = FAMILY

    with pytest.raises(RequestError, match="feetech devices have no wag tail"):
        target.able(Box(), "wag_tail")


def test_an_option_that_a_verb_lacks_is_refused(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        one = target.face(bus, 1)
        target.takes(one, "move", ["velocity", "acceleration"])
        target.takes(one, "write", ["anything"])
        with pytest.raises(RequestError, match="has no colour"):
            target.takes(one, "move", ["colour"])
        with pytest.raises(RequestError, match="have no dance"):
            target.takes(one, "dance", [])


def test_a_bus_of_can_has_a_bit_rate_and_ids_in_hexadecimal() -> None:
    serial, on_can = families.load("feetech"), families.load("kst")
    assert [target.rate_word(one) for one in (serial, on_can)] == ["baud", "bitrate"]
    assert [target.id_shown(37, one) for one in (serial, on_can)] == ["37", "37 (0x25)"]
    assert "--bitrate all" in str(target.nobody("kst:can://slcan/dev/ttyACM0"))


def test_what_no_device_of_a_family_can_is_known_without_a_bus() -> None:
    target.offers(families.load("feetech"), "enable_torque")
    with pytest.raises(RequestError, match="kst devices have no torque switch"):
        target.offers(families.load("kst"), "enable_torque")


def test_an_option_may_be_said_as_a_flag() -> None:
    with target.opened("kst:sim,ids=1", {"id-format": "ext"}, Output()) as bus:
        assert bus.run(bus.driver.identify(1)).node == 1


def test_a_name_of_the_machine_file_is_a_target(bench: Bench) -> None:
    urls = {name: simulation.url for name, simulation in bench.simulations.items()}
    assert target.target("a2")[::2] == (urls["arm"], (2,))
    assert target.device("c1").bus == urls["can"]
    assert target.gathered(["upper", "arm#3", "lift"]) == {urls["arm"]: (1, 2, 3), urls["stage"]: (1,)}
    assert [one.bus for one in target.targets("all")] == list(urls.values())
    with pytest.raises(RequestError, match="all is on 3 buses"):
        target.target("all")
