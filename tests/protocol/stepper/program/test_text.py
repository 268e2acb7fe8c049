"""Files: what is read, what is refused and how that is told, and that what is written is read as the same."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper.program import text
from motorbus.families.stepper.program.text import Source
from motorbus.families.stepper.table import Project, Step
from tests.protocol.stepper.projects import MOTOR, STEP, file, projects


def test_a_file_is_read() -> None:
    found = text.parse(
        file(
            '[[step]]\nmove = "-90 deg"\nspeed = "100 rpm"\nwait_for = "go"\nstop_on = 5\noutput = "valve off"\n'
            'delay = "1.5 s"',
            "[loop]\nfirst = 1\nlast = 2\ncount = 4\n[inputs]\ngo = 2\n[outputs]\nvalve = 3",
            top='name = "Ärm"\nproject = 4\nrepeat = "endless"',
        )
    )
    project = found.project
    assert (found.name, found.inputs, found.outputs) == ("Ärm", {"go": 2}, {"valve": 3})
    assert found.lead == 5
    assert (project.number, project.total_steps, project.project_loop) == (4, 2, 255)
    assert (project.loop_first, project.loop_last, project.loop_count) == (1, 2, 4)
    assert (project.microsteps, project.step_angle, project.turn_distance, project.stop_mode) == (
        8,
        180,
        5000,
        0,
    )
    assert project.step(1) == Step(distance=10_000, speed=60, start_frequency=200, acceleration=100)
    assert project.step(2) == Step(
        distance=1250, direction=1, speed=100, start_input=2, stop_input=5, output=7, delay=1500
    )


@pytest.mark.parametrize(
    ("unit", "turn"),
    [("pulse", 1600), ("0.001 mm", 5000), ("0.01 deg", 36000), ("turn", 1), ("2 pulses", 800)],
)
def test_the_unit_of_distances_may_be_said(unit: str, turn: int) -> None:
    motor = MOTOR.replace("turn_distance = 5000", f'unit = "{unit}"')
    found = text.parse(file(motor=motor).replace("10 mm", "1 turn"))
    assert found.project.turn_distance == turn
    assert found.project.step(1).distance == turn


def test_a_motor_may_be_said_by_its_full_steps() -> None:
    motor = MOTOR.replace('step_angle = "1.8 deg"', "full_steps = 48").replace(
        "microsteps = 8", "microsteps = 25"
    )
    project = text.parse(file(motor=motor)).project
    assert (project.step_angle, project.microsteps) == (180, 6)
    assert project.pulses_per_turn == 1200
    told = text.parse(file(motor=motor)).motor
    assert (
        told
        == "48 full steps of 25 microsteps are stored as 1.8 deg and 6 microsteps: 1200 pulses a turn either way"
    )
    plain = MOTOR.replace('step_angle = "1.8 deg"', "full_steps = 200")
    assert text.parse(file(motor=plain)).motor == text.parse(file()).motor == ""


@pytest.mark.parametrize(
    ("source", "says", "allows"),
    [
        ("format = 1\n[motor", "the file is no TOML", "TOML"),
        ("x" * ((1 << 20) + 1), "1048577 characters", "at most"),
        ("a = " + "[" * 5000, "the file is no TOML", "TOML"),
        ("a = " + "9" * 5000, "the file is no TOML: a number has thousands of digits\n", "TOML"),
        ("", "^format: is missing.*\n.*\n.*write that first; nothing was sent", "format = 1"),
        ("format = 2", "format: 2 is not known", "format = 1"),
        ("format = true", "format: True is not known", "format = 1"),
        (file(top="colour = 3"), "the file: there is no field 'colour'", "one of format"),
        (file("dealy = 3"), "step 1: there is no field 'dealy'", "perhaps delay"),
        (file(steps=11), "the file has 11 steps", "1 to 10"),
        (file(steps=0), "the file has 0 steps", "1 to 10"),
        (file(top="project = 5"), "project: 5", "1 to 4"),
        (file(top="project = 0"), "project: 0", "1 to 4"),
        (file(top="project = 1.0"), "project: 1.0 is no whole number", "whole number"),
        (file(top="project = " + "9" * 4000), "^project: 9{40}… is not possible\n", "1 to 4"),
        (file(top="x" * 4000 + " = 1"), "there is no field 'x{39}…\n", "format"),
        (file("[loop]\nfirst = 11\nlast = 12\ncount = 2"), r"\[loop\], first: 11", "0 to 10"),
        (file(motor=MOTOR.replace("microsteps = 8", "microsteps = 0")), "microsteps: 0", "1 to 65535"),
        (
            file(motor=MOTOR.replace("turn_distance = 5000", 'unit = "0.0000001 mm"')),
            "unit: '0.0000001 mm'",
            "raw 1 to",
        ),
        (file(top="repeat = 255"), "repeat: 255", "endless"),
        (file(top="repeat = -1"), "repeat: -1", "0 to 254"),
        (file(top='repeat = "often"'), "repeat: 'often'", "endless"),
        (file(top="name = 3"), "name: 3 is no text", "text"),
        (file(top='expert = "yes"'), "expert: 'yes' is neither", "true or false"),
        (file(top="total_steps = 2"), "total_steps: 2, but the file has 1", "1 to 1"),
        (file(top="total_steps = 0"), "total_steps: 0", "1 to 10"),
        (file('delay = "4 h 40 min"'), "step 1, delay: '4 h 40 min'", "4 h 39 min 37.215 s"),
        (file(motor=MOTOR.replace("1.8 deg", "2.56 deg")), "step_angle: '2.56 deg'", "0.01 deg to 2.55 deg"),
        (
            file(
                motor=MOTOR.replace("1.8 deg", "2.56 deg").replace("turn_distance = 5000", 'unit = "pulse"')
            ),
            "step_angle: '2.56 deg'",
            "0.01 deg to 2.55 deg",
        ),
        (file(motor=MOTOR.replace("= 8", "= 65536")), "microsteps: 65536", "1 to 65535"),
        (file(motor=MOTOR.replace("microsteps = 8", "")), "microsteps: they are missing", "1 to 65535"),
        (file(motor=MOTOR.replace("= 5000", "= 0")), "turn_distance: 0", "1 to 16777215"),
        (file(motor=MOTOR.replace("turn_distance = 5000", "")), "needs turn_distance or unit", "unit"),
        (file(motor=MOTOR + "unit = 'pulse'"), "needs turn_distance or unit, one of them", "unit"),
        (file(motor=MOTOR + "full_steps = 200"), "needs step_angle or full_steps", "step_angle"),
        (file(motor=MOTOR + "stop = 'hard'"), "stop: 'hard'", "slow or immediate"),
        (file(motor=MOTOR + "mode4 = 3"), "mode4: 3", "0 to 2"),
        (file(motor=MOTOR + "home_at_power_on = 1"), "home_at_power_on: 1 is neither", "true or false"),
        (
            file(motor=MOTOR.replace("turn_distance = 5000", 'unit = "0.3 mm"')),
            "only whole ones",
            "16 units per turn or 17",
        ),
        (
            file(motor=MOTOR.replace("turn_distance = 5000", 'unit = "5 units"')),
            "no unit of distance here",
            "pulse",
        ),
        (file(motor="motor = 3"), "motor: 3 is no table", r"\[motor\]"),
        (file('move = "1 mm"'), "the file is no TOML", "TOML"),  # twice
        (
            file().replace('move = "10 mm"', 'move = "16777216 units"'),
            "step 1, move: '16777216 units'",
            "0 to 16777215 units, either way",
        ),
        (file().replace('speed = "60 rpm"', ""), "step 1, speed: it is missing", "60 rpm"),
        (
            file().replace('speed = "60 rpm"', 'speed = "65536 rpm"'),
            "step 1, speed: '65536 rpm'",
            "0 to 65535 rpm",
        ),
        (file().replace("200 Hz", "70 kHz"), "step 1, start: '70 kHz'", "0 Hz to 65535 Hz"),
        (file("wait_for = 3"), "step 1, wait_for: 3", "1, 2, 5"),
        (file('stop_on = "input 4"'), "step 1, stop_on: 'input 4'", "1, 2, 5"),
        (file("wait_for = 6", top="expert = true"), "step 1, wait_for: 6", "1, 2, 3, 4, 5"),
        (
            file("[loop]\nfirst = 1\nlast = 2\ncount = 2"),
            "1 to 2 is no range of the 1 steps",
            "first <= last",
        ),
        (file("[loop]\nfirst = 1\nlast = 1"), "it needs first, last and count", "count"),
        (file("[loop]\nfirst = 1\nlast = 1\ncount = 255"), r"\[loop\], count: 255", "0 to 254"),
        (file(steps=0) + "step = 3", "there is no field 'step'|no list of steps", ""),
    ],
)
def test_what_cannot_be_is_refused_in_one_message(source: str, says: str, allows: str) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        text.parse(source)
    assert "\n" not in caught.value.summary
    assert re.search(allows, caught.value.expected)


def test_steps_must_be_tables() -> None:
    with pytest.raises(RequestError, match="no list of steps"):
        text.parse("format = 1\nstep = [1]\n" + MOTOR)


def test_an_expert_may_use_inputs_3_and_4() -> None:
    found = text.parse(file("wait_for = 3", top="expert = true"))
    assert found.expert
    assert found.project.step(1).start_input == 3
    assert "expert = true" in text.write(found)


@given(projects(), st.sampled_from([None, Fraction(5), Fraction(1, 8), Fraction(1270, 100)]))
def test_what_is_written_is_read_as_the_same(project: Project, lead: Fraction | None) -> None:
    source = Source(project, 'a "name" \\ \n', {"go on": 2}, {"lamp": 1}, lead)
    written = text.write(source)
    assert text.parse(written) == source
    assert text.write(text.parse(written)) == written


@pytest.mark.parametrize(
    ("project", "says"),
    [
        (Project(), "project 0 has been cleared"),
        (Project(number=1), "project 1 has been cleared"),
        (Project(number=5, total_steps=1), "project: 5"),
        (
            Project(number=1, microsteps=8).with_step(4, output=9),
            "project 1 has been cleared: .* to say; microsteps, step 4 were written since\n(.*\n)*.*keep it as a dump",
        ),
        (
            Project(number=1, total_steps=1, microsteps=8, step_angle=180, turn_distance=1).with_step(
                1, output=9
            ),
            "output: 9",
        ),
        (
            Project(number=1, total_steps=1, microsteps=8, step_angle=180, turn_distance=1).with_step(
                4, output=9
            ),
            "step 4, output: 9",
        ),
        (Project(number=1, total_steps=11, microsteps=8, step_angle=180, turn_distance=1), "total_steps: 11"),
    ],
)
def test_what_no_file_may_say_is_refused(project: Project, says: str) -> None:
    with pytest.raises(RequestError, match=says):
        text.write(Source(project))


LOOP = "[loop]\nfirst = 2\nlast = 5\ncount = 2"
NO_TURN = MOTOR.replace("= 5000", "= 0")


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (file(LOOP, top="#", steps=4), "2 to 5 is no range of the 4 steps"),
        (file(LOOP.replace("5", "1"), top="#", steps=4), "2 to 1 is no range of the 4 steps"),
        (file(LOOP.replace("count = 2", "count = 255"), top="#", steps=5), r"\[loop\], count: 255"),
        (
            file(top="#", motor=MOTOR.replace("1.8 deg", "0.00 deg")).replace("10 mm", "9 units"),
            "step_angle: '0.00 deg'",
        ),
        (file(top="#", motor=MOTOR.replace("= 8", "= 0")).replace("10 mm", "9 units"), "microsteps: 0"),
        (file(top="#", motor=NO_TURN).replace("10 mm", "9 units"), "turn_distance: 0"),
    ],
)
def test_what_a_controller_may_hold_only_an_expert_says(source: str, says: str) -> None:
    """A person who writes it has made a slip; a file that is made of a dump must say what the dump says."""
    with pytest.raises(RequestError, match=says):
        text.parse(source)
    found = text.parse(source.replace("#", "expert = true"))
    assert text.parse(text.write(found)) == found
    assert text.write(found._replace(expert=False)) == text.write(found)


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (file(LOOP.replace("5", "11"), top="expert = true", steps=4), r"\[loop\], last: 11"),
        (file(LOOP.replace("count = 2", "count = 256"), top="expert = true", steps=5), "0 to 255"),
        (file(top="expert = true", motor=NO_TURN), "'10 mm' has no unit of distance that is known here"),
        (
            file(
                top="expert = true",
                motor=MOTOR.replace("1.8", "0").replace("turn_distance = 5000", "unit = 'pulse'"),
            ),
            "unit: 'pulse' is no unit of distance here",
        ),
        (
            file(top="expert = true", motor=MOTOR.replace("= 8", "= 0")).replace("60 rpm", "9 Hz"),
            "speed: '9 Hz'",
        ),
    ],
)
def test_what_no_controller_holds_an_expert_does_not_say_either(source: str, says: str) -> None:
    with pytest.raises(RequestError, match=says):
        text.parse(source)


def test_units_that_need_a_lead_are_offered_only_with_one() -> None:
    lead = 'lead = "5 mm"\n'
    for old, new in (("10 mm", "1 inch"), ("60 rpm", "1 mph"), ("turn_distance = 5000", 'unit = "1 inch"')):
        for source, offered in ((file(), True), (file().replace(lead, "").replace("10 mm", "1 turn"), False)):
            with pytest.raises(RequestError) as caught:
                text.parse(source.replace(old if offered or old != "10 mm" else "1 turn", new))
            assert ("mm" in caught.value.expected) is offered, caught.value.expected


def test_a_step_is_written_as_short_as_it_is() -> None:
    project = text.parse(file(STEP)).project
    lines = text.write(Source(project.with_step(2, distance=0, speed=0, start_frequency=0, acceleration=0)))
    assert lines.endswith('acceleration = "100 Hz"\n\n[[step]]\n')


# --- anything at all -----------------------------------------------------------------------------------------------

WEIRD = st.sampled_from(
    [
        "0",
        "-1",
        "1.5",
        "nan",
        "inf",
        "true",
        "''",
        "'x'",
        "[]",
        "[1]",
        "{}",
        "{a=1}",
        "1979-05-27",
        "07:32:00",
        "1e400",
        "99999999999999999999999",
        "'1mm'",
        "'-1turns'",
        "'none'",
        "'0Hz'",
        "'1/0mm'",
        "'endless'",
        "'1e9s'",
    ]
)
KEYS = st.sampled_from([*text.TOP, *text.MOTOR, *text.LOOP, *text.STEP])


def parsed_or_refused(source: str) -> None:
    try:
        found = text.parse(source)
    except RequestError:
        return
    assert text.parse(text.write(found)).project == found.project


@given(
    st.lists(st.tuples(KEYS, WEIRD), max_size=4),
    st.sampled_from(["", "[motor]", "[loop]", "[inputs]", "[[step]]"]),
)
def test_any_value_of_any_field_is_taken_or_refused(pairs: list[tuple[str, str]], table: str) -> None:
    lines = "\n".join(f"{key} = {value}" for key, value in dict(pairs).items())
    parsed_or_refused(file(f"{table}\n{lines}") if table else file(top=lines))
    for key, value in pairs:
        source = re.sub(rf"(?m)^{key} = .*$", lambda _, key=key, value=value: f"{key} = {value}", file())  # type: ignore[misc]
        parsed_or_refused(source)


@given(st.data())
def test_a_file_with_a_slip_of_the_finger_is_read_or_refused(data: st.DataObject) -> None:
    source = file("[loop]\nfirst = 1\nlast = 1\ncount = 3", top='name = "x"\nrepeat = 3', steps=2)
    at = data.draw(st.integers(0, len(source)))
    cut = data.draw(st.integers(0, 3))
    parsed_or_refused(source[:at] + data.draw(st.text(max_size=3)) + source[at + cut :])
