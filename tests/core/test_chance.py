"""Chance is the same for the same seed, and spread over its range."""

from __future__ import annotations

from motorbus.core.chance import Chance


def test_the_known_first_numbers_of_splitmix64() -> None:
    # the generator's published test values for seed 1234567: 6457827717110365317, 3203168211198807973
    chance = Chance(1234567)
    assert [int(chance.draw() * (1 << 53)) for _ in range(2)] == [
        6457827717110365317 >> 11,
        3203168211198807973 >> 11,
    ]


def test_the_same_seed_gives_the_same_and_another_gives_others() -> None:
    one, same, other = Chance(7), Chance(7), Chance(8)
    numbers = [one.draw() for _ in range(1000)]
    assert numbers == [same.draw() for _ in range(1000)]
    assert numbers != [other.draw() for _ in range(1000)]
    assert all(0 <= number < 1 for number in numbers)
    assert 450 < sum(number < 0.5 for number in numbers) < 550
