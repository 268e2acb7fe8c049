"""A project as a program: a file that can be read, checked, timed, planned and turned into frames.

    program = Program.load("pick.toml")
    print(program.estimate())          # at least 41.6 s + 6 waits
    for finding in program.lint():
        print(finding)

Nothing here talks to a controller. The same numbers go three ways: the file that people write, the 220 bytes that a
controller stores, and the command frames that carry them there. File and bytes come back from each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from types import MappingProxyType

from motorbus.families.stepper import wire
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program import dumps, text
from motorbus.families.stepper.program.lint import RULES, USUALLY, Conditions, Finding, Rule, lint, net_units
from motorbus.families.stepper.program.plan import Estimate, Plan, StepPlan, duration, estimate, plan
from motorbus.families.stepper.program.source import read
from motorbus.families.stepper.table import BLANK, Order, Project, encode_image

_NOTHING: Mapping[str, int] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """A project and what people call it.

    `inputs` and `outputs` give names to numbers, `lead` is mm for one turn where that is known. `motor` says how the
    motor is told where its file says it otherwise (`full_steps`). `raw` are the 220 bytes it was read from, if it was:
    what no field names is kept in them.
    """

    project: Project
    name: str = ""
    inputs: Mapping[str, int] = field(default_factory=lambda: _NOTHING)
    outputs: Mapping[str, int] = field(default_factory=lambda: _NOTHING)
    lead: Fraction | None = None
    expert: bool = False
    motor: str = ""
    raw: bytes = b""

    # -- from what it is made ---------------------------------------------------------------------------------

    @classmethod
    def parse(cls, source: str) -> Program:
        """From the text of a file. Raises RequestError, naming step and field, for what cannot be."""
        found = text.parse(source)
        return cls(
            project=found.project, name=found.name, inputs=found.inputs, outputs=found.outputs, lead=found.lead,
            expert=found.expert, motor=found.motor,
        )  # fmt: skip

    @classmethod
    def load(cls, path: str) -> Program:
        """From a file. Raises RequestError when it cannot be read, and for what it says."""
        return cls.parse(read(path))

    @classmethod
    def from_dump(
        cls, data: bytes, *, name: str = "", order: Order = "little", strict: bool = True
    ) -> Program:
        """From 226 or 220 bytes, or these in hexadecimal. Raises RequestError, naming the field, for what cannot be."""
        found = dumps.from_dump(data, order=order, strict=strict)
        project = replace(found.project, number=found.project.number or found.asked)
        return cls(project=project, name=name, raw=found.image)

    # -- what it becomes ---------------------------------------------------------------------------------------

    def text(self) -> str:
        """The file. Raises RequestError for numbers that no file may say."""
        return text.write(
            text.Source(self.project, self.name, self.inputs, self.outputs, self.lead, self.expert)
        )

    def image(self, order: Order = "little") -> bytes:
        """The 220 bytes; those that no field names are as they were read, or 0."""
        return encode_image(self.project, order, over=self.raw or BLANK)

    def dump(self, order: Order = "little") -> bytes:
        """The 226 bytes that a controller with this project answers."""
        return wire.encode_dump(self.project.number, self.image(order))

    def frames(self, *, motor: int = wire.MOTOR, save: bool = True) -> list[bytes]:
        """The requests that write it and, with `save`, keep it."""
        return dumps.frames(self.project, motor=motor, save=save)

    # -- what can be said of it ----------------------------------------------------------------------------------

    def lint(self, conditions: Conditions = USUALLY) -> list[Finding]:
        """What in it will not do what it seems to say."""
        image, motor = conditions.image or self.raw, conditions.motor or self.motor
        return lint(self.project, replace(conditions, image=image, motor=motor))

    def estimate(self, how: Behaviour = USUAL) -> Estimate:
        """How long it takes: str() of it is "at least 41.6 s + 6 waits" and what is uncertain."""
        return estimate(self.project, how)

    def plan(self, how: Behaviour = USUAL) -> Plan:
        """Order, time and displacement, as data."""
        return plan(self.project, how, name=self.name)

    def order(self, how: Behaviour = USUAL) -> list[int]:
        """The steps of one pass, in order."""
        return list(self.plan(how).order)


__all__ = [
    "RULES",
    "Conditions",
    "Estimate",
    "Finding",
    "Plan",
    "Program",
    "Rule",
    "StepPlan",
    "duration",
    "estimate",
    "lint",
    "net_units",
    "plan",
]
