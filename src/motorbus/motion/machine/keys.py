"""The keys of each table as rows, taken from the types: what reading, schema, fresh files and the page go by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, NamedTuple, get_args, get_origin, get_type_hints

from msgspec import NODEFAULT, Meta, Struct, structs

from motorbus.core import units
from motorbus.motion.machine.model import (
    LINEAR_UNITS,
    TURNING_UNITS,
    AxisSpec,
    BusSpec,
    Description,
    GroupSpec,
    Measure,
)


class Key(NamedTuple):
    """One key of a table.

    `says` is its meaning, `hint` what msgspec checks it by and `meta` the range in it, `default` in the API's unit
    (NODEFAULT where there is none), `measure` its quantity and `usual` the default as people write it, on a turning and
    on a linear axis, "" where there is none. `example` is a value in TOML on each of the two.
    """

    name: str
    says: str
    hint: Any
    meta: Meta
    default: Any
    measure: Measure | None
    usual: tuple[str, str]
    example: tuple[str, str]

    @property
    def needs_unit(self) -> bool:
        """Whether a number needs a unit: an angle or a length, and what is measured in them."""
        return self.measure is not None and self.measure.turning not in ("current", "load")

    @property
    def needed(self) -> bool:
        """Whether a file must have it."""
        return self.default is NODEFAULT and not any(self.usual)

    @property
    def kind(self) -> Any:
        """The plain type of its value, without the range."""
        return get_args(self.hint)[0]

    def choices(self, linear: bool) -> tuple[Any, ...]:
        """The values it may have, where they can be counted."""
        if self.name == "unit":
            return LINEAR_UNITS if linear else TURNING_UNITS
        if self.kind is bool:
            return True, False
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    def units(self, linear: bool) -> tuple[str, ...]:
        """The units it may be said in; () where it is no quantity."""
        return tuple(units.SCALES[self.measure.of(linear)]) if self.measure else ()

    def range(self, linear: bool) -> str:
        """What it may be, in words: `above 0, at most 1000 A`; "" where its type says all."""
        meta, words = self.meta, ""
        if meta.ge is not None:
            words = f"{meta.ge:.10g} to {meta.le:.10g}"
        elif meta.gt is not None:
            words = f"above {meta.gt:.10g}, at most {meta.le:.10g}"
        unit = api_unit(self.measure.of(linear)) if self.measure else ""
        return f"{words} {unit}".strip() if words else ""


def word(choice: object) -> str:
    """One of the values that can be counted, as TOML has it: `hold`, `-1`, `true`."""
    return str(choice).lower() if isinstance(choice, bool) else str(choice)


def api_unit(quantity: str) -> str:
    """The unit in which the API has it: `rad` for position, "" for load, which is a plain fraction."""
    return (
        ""
        if quantity == "load"
        else next(unit for unit, measured in units.QUANTITIES.items() if measured == quantity)
    )


def _keys(kind: type[Struct]) -> Mapping[str, Key]:
    hints = get_type_hints(kind, include_extras=True)
    return {one.encode_name: _key(one, _annotated(hints[one.name])) for one in structs.fields(kind)}


def _key(one: structs.FieldInfo, hint: Any) -> Key:
    meta: Meta = get_args(hint)[1]
    extra = meta.extra or {}
    default = one.default if one.default_factory is NODEFAULT else one.default_factory()
    given = extra["measure"], extra["usual"], extra["example"]
    return Key(one.encode_name, meta.description or "", hint, meta, default, *given)


def _annotated(hint: Any) -> Any:
    """The `Annotated[type, Meta]` of a field, be it there or in a union with None."""
    return next(one for one in (hint, *get_args(hint)) if get_origin(one) is Annotated)


TOP: Final = {"format": "", **{one.encode_name: one.name for one in structs.fields(Description)}}
"""Keys of the file itself, and the attribute that each becomes."""
BUS: Final = _keys(BusSpec)
AXIS: Final = _keys(AxisSpec)
GROUP: Final = _keys(GroupSpec)
FILE: Final = _keys(Description)
POSE: Final = AXIS["low"]._replace(
    name="AXIS", says="where this axis is in the pose", example=('"10 deg"', '"30 mm"')
)
"""Of a pose, whose keys are the names of axes."""
