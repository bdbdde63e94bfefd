"""The report page in a real browser: nothing to complain of, nothing loaded, usable by keyboard, readable by all."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from replay.events import Event, Finished, Merged
from replay.html.page import page
from replay.html.story import StoryTeller
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath
from scripts.browser import browser, missing, show
from tests.bags import write_mcap
from tests.pages import page_of
from tests.runs import bare_room, in_log_order, seen, two_robots
from tests.scenarios import SCENARIOS, events_of
from tests.viewers import require

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

DESK, PHONE = 1400, 375
LONG = ("r" * 90, "many words " * 8, "<b>bold</b> & 'quoted'", "робот机器人🤖")
RULES = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]}


@pytest.fixture(scope="module", params=[False, True], ids=["light", "dark"])
def chrome(request: pytest.FixtureRequest) -> Iterator[Chrome]:
    require(missing())
    with ExitStack() as stack:
        yield stack.enter_context(browser(dark=request.param))


def many_robots(folder: Path) -> list[Event]:
    """Return a run of twenty robots, of which two are merged, some with long names."""
    names = [*LONG, *(f"r{index}" for index in range(3, 19))]
    strangers = [seen("", 4.0 + index, bare_room(), topic=f"/{name}/map") for index, name in enumerate(names)]
    run = write_mcap(folder / "many.mcap", in_log_order(two_robots(), strangers))
    return list(merge(RunOptions((RunPath(None, run),), ("r1", "r2", *names))))


def many_ticks() -> list[Event]:
    """Return a run in which nothing new was said ten thousand times."""
    started, *_, last = events_of("merged")
    ticks = [event for event in events_of("merged") if isinstance(event, Merged)]
    calm = replace(ticks[-1], result=replace(ticks[-1].result, changes=()))
    after = [replace(calm, stamp_ns=calm.stamp_ns + index * 10**8) for index in range(10_000)]
    assert isinstance(last, Finished)
    return [started, *ticks, *after, last]


def told(events: Sequence[Event]) -> str:
    teller = StoryTeller()
    stories = [teller.take(event) for event in events]
    assert stories[-1] is not None
    return page(stories[-1])


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    texts = {name: page_of(name) for name in SCENARIOS}
    texts |= {"many_robots": told(many_robots(folder)), "many_ticks": told(many_ticks())}
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: folder / f"{name}.html" for name in texts}


EVERY = [*SCENARIOS, "many_robots", "many_ticks"]


def open_page(chrome: Chrome, path: Path, width: int = DESK) -> None:
    for log in ("browser", "performance"):
        chrome.get_log(log)  # of what was shown before
    show(chrome, path, width)


def requests(chrome: Chrome) -> list[str]:
    """Return what was asked for since the page was opened, but for data that the page holds itself."""
    messages = [json.loads(entry["message"])["message"] for entry in chrome.get_log("performance")]
    sent = [each["params"]["request"]["url"] for each in messages if each["method"] == "Network.requestWillBeSent"]
    return [url for url in sent if not url.startswith("data:")]


@pytest.mark.parametrize("width", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize("name", EVERY)
def test_nothing_to_complain_of(chrome: Chrome, pages: dict[str, Path], name: str, width: int) -> None:
    open_page(chrome, pages[name], width)
    assert chrome.get_log("browser") == []
    assert requests(chrome) == [pages[name].as_uri()]
    wide = "return [document.documentElement.scrollWidth, document.body.scrollWidth, innerWidth]"
    assert chrome.execute_script(wide) == [width, width, width]


@pytest.mark.parametrize("width", [320, 600, 800, 1061, 1261])
@pytest.mark.parametrize("name", ["three_robots_one_unplaced", "many_robots", "believed"])
def test_it_fits_any_window(chrome: Chrome, pages: dict[str, Path], name: str, width: int) -> None:
    open_page(chrome, pages[name], width)
    beyond = """
        const scrolled = '.scroll, .cards.small, pre, svg, .sheet';
        return [...document.querySelectorAll('main *')]
            .filter((each) => each.getClientRects().length && !each.closest(scrolled))
            .filter((each) => each.getBoundingClientRect().right > innerWidth + 1)
            .map((each) => each.outerHTML.slice(0, 150))
    """
    assert chrome.execute_script(beyond) == []
    box = "document.querySelector('.robots').parentElement"
    assert chrome.execute_script(f"return {box}.scrollWidth - {box}.clientWidth") <= 0


@pytest.mark.parametrize(
    "name", ["three_robots_one_unplaced", "restarted", "no_reference", "believed", "driven", "many_robots"]
)
@pytest.mark.parametrize("width", [DESK, PHONE], ids=["desk", "phone"])
def test_it_is_accessible_to_all(chrome: Chrome, pages: dict[str, Path], name: str, width: int) -> None:
    open_page(chrome, pages[name], width)
    chrome.execute_script("for (const each of document.querySelectorAll('details')) each.open = true")
    assert violations(chrome) == []
    if name == "three_robots_one_unplaced":
        chrome.execute_script("document.querySelector('.thumb').click()")
        assert violations(chrome) == []


def test_what_is_not_is_found(chrome: Chrome, pages: dict[str, Path]) -> None:
    open_page(chrome, pages["merged"])
    chrome.execute_script("document.querySelector('h1').style.color = 'color-mix(in srgb, var(--panel), gray 30%)'")
    chrome.execute_script("document.querySelector('img').removeAttribute('alt')")
    assert {rule for rule, _ in violations(chrome)} == {"color-contrast", "image-alt"}


def test_light_and_dark_are_what_the_user_likes(chrome: Chrome, pages: dict[str, Path]) -> None:
    open_page(chrome, pages["merged"])
    dark = chrome.execute_script("return matchMedia('(prefers-color-scheme: dark)').matches")
    red = (
        chrome.execute_script("return getComputedStyle(document.body).backgroundColor").partition("(")[2].split(",")[0]
    )
    assert (int(red) < 60) == dark


def violations(chrome: Chrome) -> list[Any]:
    from selenium_axe_python import Axe

    axe = Axe(chrome)
    axe.inject()
    results = axe.run(options=RULES)
    return [(each["id"], [node["html"][:200] for node in each["nodes"]][:3]) for each in results["violations"]]


class TestByKeyboard:
    @pytest.fixture(autouse=True)
    def opened(self, chrome: Chrome, pages: dict[str, Path]) -> None:
        open_page(chrome, pages["three_robots_one_unplaced"])
        self.chrome = chrome

    def press(self, *keys: str) -> None:
        from selenium.webdriver import ActionChains

        ActionChains(self.chrome).send_keys(*keys).perform()

    def focused(self, script: str) -> Any:
        return self.chrome.execute_script(f"const now = document.activeElement; return {script}")

    def tab_to(self, condition: str) -> None:
        from selenium.webdriver import Keys

        for _ in range(80):
            self.press(Keys.TAB)
            if self.focused(condition):
                return
        raise AssertionError(f"no tab leads to {condition}")

    def scale(self, root: str) -> float:
        transform = self.chrome.execute_script(f"return document.querySelector('{root} .sheet').style.transform")
        return float(transform.partition("scale(")[2].rstrip(")"))

    def test_the_first_tab_leads_past_the_head(self) -> None:
        from selenium.webdriver import Keys

        self.press(Keys.TAB)
        assert self.focused("now.textContent") == "Skip to the outcome"
        self.press(Keys.ENTER)
        assert self.chrome.current_url.endswith("#main")

    def test_the_map_is_zoomed_and_moved(self) -> None:
        from selenium.webdriver import Keys

        self.tab_to("now.matches('#merged .stage')")
        self.press("+", "+", Keys.ARROW_RIGHT)
        assert self.scale("#merged") == pytest.approx(2.25)
        self.press("-")
        assert self.scale("#merged") == pytest.approx(1.5)
        self.press("0")
        assert self.scale("#merged") == 1.0
        self.tab_to("now.dataset.zoom === 'in'")
        self.press(Keys.ENTER)
        assert self.scale("#merged") == pytest.approx(1.5)

    def test_layers_are_switched(self) -> None:
        self.tab_to("now.matches('input[data-layer=\"3\"]')")
        hidden = "return document.querySelector('#merged img[data-layer=\"3\"]').hidden"
        assert not self.chrome.execute_script(hidden)
        self.press(" ")
        assert self.chrome.execute_script(hidden)

    def test_a_picture_opens_and_closes_and_the_focus_returns(self) -> None:
        from selenium.webdriver import Keys

        opened = "return document.getElementById('zoom').open"
        self.tab_to("now.matches('.pair .thumb')")
        title = self.focused("now.dataset.title")
        self.press(Keys.ENTER)
        assert self.chrome.execute_script(opened)
        assert self.chrome.execute_script("return document.getElementById('zoom-title').textContent") == title
        assert self.focused("Boolean(now.closest('dialog'))")
        self.tab_to("now.matches('dialog .stage')")
        self.press("+")
        assert self.scale("#zoom") == pytest.approx(1.5)
        self.press(Keys.ESCAPE)
        assert not self.chrome.execute_script(opened)
        assert self.focused("now.matches('.pair .thumb') && now.dataset.title") == title

    def test_values_are_told_at_any_time(self) -> None:
        from selenium.webdriver import Keys

        said = "return document.querySelector('#when-said').textContent"
        values = "return [...document.querySelectorAll('.plot .value')].map((each) => each.textContent)"
        self.tab_to("now.id === 'when'")
        last = self.chrome.execute_script(values)
        assert all(last)
        self.press(Keys.HOME)
        assert self.chrome.execute_script(said) == "+0.0 s"
        assert self.chrome.execute_script(values) != last

    def test_the_theme_is_chosen(self) -> None:
        from selenium.webdriver import Keys

        ground = "return getComputedStyle(document.body).backgroundColor"
        self.tab_to("now.id === 'theme'")
        seen_grounds = []
        for expected in ("light", "dark"):
            self.press(Keys.ENTER)
            assert self.focused("now.textContent") == f"Theme: {expected}"
            seen_grounds.append(self.chrome.execute_script(ground))
        assert len(set(seen_grounds)) == 2
        assert violations(self.chrome) == []


def test_the_map_is_zoomed_by_wheel_only_when_it_is_meant(chrome: Chrome, pages: dict[str, Path]) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    open_page(chrome, pages["merged"])
    stage = chrome.find_element(By.CSS_SELECTOR, "#merged .stage")
    chrome.execute_script("arguments[0].scrollIntoView({block: 'center'})", stage)
    zoomed = "return document.querySelector('#merged .stage').classList.contains('zoomed')"
    origin = ScrollOrigin.from_element(stage)
    ActionChains(chrome).scroll_from_origin(origin, 0, -60).perform()
    assert not chrome.execute_script(zoomed)
    chrome.execute_script("arguments[0].scrollIntoView({block: 'center'})", stage)
    ActionChains(chrome).click(stage).perform()
    ActionChains(chrome).scroll_from_origin(origin, 0, -200).perform()
    WebDriverWait(chrome, 10).until(lambda _: chrome.execute_script(zoomed))


def test_ways_are_switched_and_stay_thin(chrome: Chrome, pages: dict[str, Path]) -> None:
    open_page(chrome, pages["driven"])
    script = "return getComputedStyle(document.querySelector('.ways .way:not(.edge)')).strokeWidth"
    thin_px = float(chrome.execute_script(script).removesuffix("px"))
    chrome.execute_script("document.querySelector('#merged [data-zoom=in]').click()")
    assert float(chrome.execute_script(script).removesuffix("px")) == pytest.approx(thin_px / 1.5, rel=0.01)
    shown = "return document.querySelector('.ways').getClientRects().length"
    assert chrome.execute_script(shown) == 1
    chrome.execute_script("document.querySelector('input[data-layer=ways]').click()")
    assert chrome.execute_script(shown) == 0


def test_what_is_shown_is_in_the_legend_of_a_print(chrome: Chrome, pages: dict[str, Path]) -> None:
    open_page(chrome, pages["driven"])
    labels = """return [...document.querySelectorAll('.layers label, #merged .legend')]
        .filter((each) => each.getClientRects().length).map((each) => each.textContent.trim().split(':')[0])"""
    always = ["merged map", "walls of r1", "walls of r2"]
    chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        tinted = ["where maps overlap", "where robots drove", "Where maps overlap"]
        assert chrome.execute_script(labels) == [*always, *tinted]
        for layer in ("ways", "3"):
            chrome.execute_script(f"document.querySelector('input[data-layer=\"{layer}\"]').click()")
        assert chrome.execute_script(labels) == always
    finally:
        chrome.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_it_is_read_without_scripts(chrome: Chrome, pages: dict[str, Path]) -> None:
    chrome.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        open_page(chrome, pages["three_robots_one_unplaced"])
        source = chrome.page_source
    finally:
        chrome.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
    assert "2 of 3 maps are merged." in source
    assert 'id="theme" hidden' in source
