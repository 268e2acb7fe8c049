"""The page in Chromium: what a user sees and does. `make browser` installs Chromium, `make assets` the libraries."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from motorbus.web import service as services
from motorbus.web.app import LIBRARIES, STATIC
from tests.web.demo import Served, serve, wait_for

NOT_INSTALLABLE = Path(__file__).parents[2] / "build/no-browser"
CONSOLE: list[str] = []  # of the pages of the present test
expect.set_options(timeout=10_000)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    missing = [name for name in LIBRARIES if not (STATIC / "vendor" / name).exists()]
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or playwright.chromium.executable_path
        if missing or not Path(path).exists():
            why = "`make browser assets` installs what this test needs"
            pytest.skip(why) if NOT_INSTALLABLE.exists() or not os.environ.get("CI") else pytest.fail(why)
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setattr(services, "LEASE", 1.5)  # Chromium shares the processor with other tests
    with serve(tmp_path) as one:
        yield one


@pytest.fixture(autouse=True)
def no_console_output() -> Iterator[None]:
    CONSOLE.clear()
    yield
    assert CONSOLE == []


def show(browser: Browser, served: Served, width: int = 1366) -> Page:
    """Open the page; anything on its console fails the test."""
    page = browser.new_page(viewport={"width": width, "height": 850})
    page.on("console", lambda message: CONSOLE.append(message.text))
    page.on("pageerror", lambda error: CONSOLE.append(str(error)))
    page.goto(served.server.url)
    expect(page.get_by_test_id("link")).to_have_text("live")
    return page


@pytest.fixture
def page(browser: Browser, served: Served) -> Iterator[Page]:
    page = show(browser, served)
    expect(page.get_by_role("button", name="Release")).to_be_visible()
    yield page
    page.close()


def drag(page: Page, name: str, share: float) -> None:
    """Press on the slider of an axis at this share of its width, and hold."""
    box = page.get_by_label(f"target of {name}").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] * share, box["y"] + box["height"] / 2)
    page.mouse.down()


def test_a_slider_moves_and_clamps(page: Page, served: Served) -> None:
    drag(page, "base", 0.6)
    page.mouse.up()
    wait_for(lambda: 0.3 < served.position("base") < 0.8)
    expect(page.get_by_test_id("axis-base").get_by_test_id("position")).to_have_text(
        re.compile(r"[23]\d\.\d deg")
    )
    drag(page, "base", 0.7)
    page.mouse.move(1365, 5)  # far outside
    page.mouse.up()
    wait_for(lambda: abs(served.position("base") - 2.618) < 0.05)


@pytest.mark.parametrize("how", ["button", "Escape", "Space"])
def test_a_stop_in_motion(page: Page, served: Served, how: str) -> None:
    page.get_by_role("button", name="Pose reach").click()
    wait_for(lambda: served.position("base") > 0.1)
    if how == "button":
        page.locator("#stop").click()
    else:
        page.keyboard.press(how)
    expect(page.get_by_test_id("activity")).to_be_hidden()
    assert served.position("base") < 1.0
    expect(page.get_by_test_id("messages")).to_contain_text("stop")


def test_a_stop_ends_a_drag(page: Page, served: Served) -> None:
    drag(page, "base", 0.9)
    wait_for(lambda: served.position("base") > 0.1)
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("activity")).to_be_hidden()
    at = served.position("base")
    page.mouse.move(900, 300)  # the button is still held
    page.wait_for_timeout(500)
    assert abs(served.position("base") - at) < 0.05
    page.mouse.up()


def test_a_closed_tab_stops_the_machine(page: Page, served: Served) -> None:
    page.get_by_label("speed").fill("0.2")
    page.get_by_role("button", name="Pose reach").click()
    wait_for(lambda: served.position("base") > 0.05)
    page.close()
    wait_for(lambda: not served.service.activity)
    assert served.position("base") < 1.15


def test_a_second_tab_watches_and_takes_over(browser: Browser, page: Page, served: Served) -> None:
    other = show(browser, served)
    expect(other.get_by_role("button", name="Pose reach")).to_be_disabled()
    page.get_by_label("speed").fill("0.2")
    page.get_by_role("button", name="Pose reach").click()
    wait_for(lambda: served.position("base") > 0.05)
    other.get_by_role("button", name="Take over").click()
    expect(other.get_by_role("button", name="Pose reach")).to_be_enabled()
    expect(page.get_by_role("button", name="Pose reach")).to_be_disabled()
    expect(other.get_by_test_id("activity")).to_be_hidden()
    assert served.position("base") < 1.15
    other.close()


def test_the_plot_draws_and_is_saved(page: Page) -> None:
    page.get_by_role("tab", name="Plot").click()
    page.get_by_label("signal", exact=True).select_option("voltage")
    page.get_by_role("button", name="Add").click()
    page.wait_for_timeout(1_000)
    inked = """canvas => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height)
        .data.some((value, index) => index % 4 === 3 && value > 0)"""
    assert page.locator("[data-testid=plot] canvas").evaluate(inked)
    page.get_by_role("button", name="Pause").click()
    for kind in ("CSV", "PNG"):
        with page.expect_download() as saved:
            page.get_by_role("button", name=kind).click()
        data = Path(saved.value.path()).read_bytes()
        assert data.startswith(
            b"s,base position (deg),base target (deg),base voltage (V)\n" if kind == "CSV" else b"\x89PNG"
        )
        assert len(data) > 150


def test_a_register_is_written_after_a_question(page: Page, served: Served) -> None:
    page.get_by_role("tab", name="Registers").click()
    page.get_by_label("search").fill("max_temp")
    row = page.get_by_test_id("value-max_temperature")
    expect(row).to_have_text("70 °C")
    row.click()
    page.get_by_label("new value").fill("300")
    expect(page.get_by_role("button", name="Write …")).to_be_disabled()
    page.get_by_label("new value").fill("65")
    page.get_by_role("button", name="Write …").click()
    expect(page.get_by_role("dialog")).to_contain_text("kept without power")
    page.locator("#stop").click()  # the question hides no stop
    page.get_by_role("dialog").get_by_role("button", name="Write").click()
    expect(row).to_have_text("65 °C")
    expect(page.get_by_test_id("messages")).to_contain_text("read back")


def test_the_sketch_has_the_shape_of_the_arm(page: Page) -> None:
    expect(page.get_by_test_id("sketch")).to_be_visible()
    lines = page.evaluate("""async () => {
        const [{ jointsOf, segments }, { link }] = [await import("/static/sketch.js"), await import("/static/link.js")];
        return segments(jointsOf(link.machine), [0, 0, 0, 0, 0, 0]); }""")
    elbow, wrist = lines[3]
    assert elbow[2] == pytest.approx(wrist[2], abs=0.006)  # at zero the forearm is level, 0.234 m high
    assert elbow[2] == pytest.approx(0.234, abs=0.01)


def test_the_doctor_finds_an_injected_fault(page: Page) -> None:
    page.get_by_role("tab", name="Faults").click()
    page.get_by_role("button", name="supply 12").click()
    page.get_by_label("axis").select_option("gripper")
    page.get_by_role("button", name="unplug", exact=True).click()
    page.get_by_role("tab", name="Axes").click()
    expect(page.get_by_test_id("axis-gripper")).to_contain_text("no reply for")
    page.get_by_role("tab", name="Doctor").click()
    page.get_by_role("button", name="Examine").click()
    expect(page.get_by_test_id("finding-device-missing")).to_contain_text("gripper", timeout=30_000)
    expect(page.get_by_test_id("finding-supply-out-of-range")).to_contain_text("base")


def test_the_set_up_is_answered(page: Page, served: Served) -> None:
    page.get_by_role("tab", name="Setup").click()
    page.get_by_role("button", name="begin verify").click()
    expect(page.get_by_role("dialog")).to_contain_text("base: ")
    served.faults.inject("arm", "push 1 30deg")
    expect(page.get_by_test_id("notes")).to_contain_text("base moves as named")
    expect(page.get_by_role("dialog")).to_contain_text("shoulder: ")
    page.get_by_role("button", name="Enter").click()
    expect(page.get_by_role("dialog")).to_contain_text("elbow: ")
    page.get_by_role("button", name="End").click()
    page.get_by_role("button", name="begin calibrate").click()
    page.get_by_role("button", name="go").click()
    expect(page.get_by_role("dialog")).to_contain_text("travel deg")
    page.get_by_role("button", name="End").click()
    expect(page.get_by_role("button", name="begin number")).to_be_enabled()


def test_no_panel_scrolls_sideways_on_a_phone(browser: Browser, served: Served) -> None:
    page = show(browser, served, 400)

    def check(what: str) -> None:
        expect(page.locator("#stop")).to_be_in_viewport()
        page.wait_for_timeout(200)
        assert page.evaluate("document.documentElement.scrollWidth") <= 400, what

    for tab in page.get_by_role("tab").all():
        tab.click()
        check(tab.inner_text())
    page.get_by_role("tab", name="Registers").click()
    page.get_by_test_id("value-max_temperature").click()
    check("editor of a register")
    page.get_by_role("tab", name="Doctor").click()
    page.get_by_role("button", name="Examine").click()
    expect(page.get_by_test_id("summary")).to_be_visible(timeout=30_000)
    check("report of the doctor")
    page.get_by_role("tab", name="Setup").click()
    page.get_by_role("button", name="begin calibrate").click()
    page.get_by_role("button", name="go").click()
    expect(page.get_by_role("table")).to_be_visible()
    check("table of the set-up")
    page.close()
