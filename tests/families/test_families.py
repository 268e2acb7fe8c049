"""Discovery: families inside the package, and families from outside by their entry point, without a list anywhere."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from motorbus import families
from motorbus.errors import RequestError

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE = ROOT / "examples" / "family_template"


def install(site: Path, *, name: str = "motorbus-template", points: dict[str, str]) -> None:
    """What an installer leaves of a distribution: its metadata with the entry points."""
    folder = site / f"{name.replace('-', '_')}-0.1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n", encoding="utf-8"
    )
    lines = "".join(f"{key} = {value}\n" for key, value in points.items())
    (folder / "entry_points.txt").write_text(f"[{families.GROUP}]\n{lines}", encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that Python looks into, with the template's package in reach."""
    monkeypatch.syspath_prepend(str(TEMPLATE))
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_every_package_inside_is_a_family() -> None:
    folders = {path.parent.name for path in Path(families.__file__).parent.glob("*/__init__.py")}
    assert folders
    assert folders <= set(families.names())
    assert {families.load(name).name for name in folders} == folders


def test_a_family_from_outside_is_found_by_its_entry_point(site: Path) -> None:
    with (TEMPLATE / "pyproject.toml").open("rb") as file:
        points = tomllib.load(file)["project"]["entry-points"]
    assert list(points) == [families.GROUP]
    install(site, points=points[families.GROUP])
    for name in points[families.GROUP]:
        assert name in families.names()
        assert families.load(name).name == name


def test_names_are_sorted_and_told_once(site: Path) -> None:
    install(site, points={"zither": "motorbus_template:FAMILY", "abacus": "motorbus_template:FAMILY"})
    found = families.names()
    assert found == sorted(set(found))
    assert {"abacus", "zither"} <= set(found)


def test_what_is_inside_goes_before_what_is_outside(site: Path) -> None:
    found = sorted(path.parent for path in Path(families.__file__).parent.glob("*/__init__.py"))
    inside = found[0].name
    install(site, points={inside: "motorbus_template:FAMILY"})
    assert families.names().count(inside) == 1
    assert families.load(inside).name == inside


def test_an_unknown_family_is_refused_and_the_known_ones_are_named() -> None:
    with pytest.raises(RequestError, match="harpsichord") as raised:
        families.load("harpsichord")
    for name in families.names():
        assert name in raised.value.expected


def test_finding_names_loads_no_family() -> None:
    code = (
        "import sys; from motorbus import families; families.names(); "
        "print([name for name in sys.modules if name.startswith('motorbus.families.')])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT / "src")
    assert ended.stdout.strip() == "[]", ended.stderr
