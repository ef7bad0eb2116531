"""Somebody at a browser of their own: what is on the page, what is done to it, and what it complains of."""

from __future__ import annotations

import base64
import io
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

from tapelayer.arrays import Floats
from tests.helpers.paths import ROOT

api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

SCREENSHOTS = ROOT / "build" / "screenshots"
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
SMALL = {"width": 1280, "height": 720}
LARGE = {"width": 2560, "height": 1440}
# A busy machine is slow, and no fault of the page.
PATIENCE_MS = 60_000

DROP = """([name, content]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([Uint8Array.from(atob(content), (sign) => sign.charCodeAt(0))], name));
    return transfer;
}"""


@contextmanager
def chromium() -> Iterator[Any]:
    """Debian's Chromium; skips where it is missing."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("chromium is not installed")
    api.expect.set_options(timeout=PATIENCE_MS)
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*ARGUMENTS])
        yield browser
        browser.close()


class Person:
    """A page in a browser that shares no cookie and no storage with another's.

    Attributes:
        page: the page.
        complaints: errors that the browser wrote down, refused requests and broken policies among them.
        addresses: every address that the page asked for.
    """

    def __init__(self, browser: Any, url: str, **context: Any) -> None:
        self.url = url
        self.context = browser.new_context(**{"viewport": SMALL, "locale": "en-GB", **context})
        self.context.set_default_timeout(PATIENCE_MS)
        self.complaints: list[str] = []
        self.addresses: list[str] = []
        self.page = self.another()

    def another(self) -> Any:
        """Another page of the same browser, which is the one that is looked at from now on."""
        self.page = self.context.new_page()
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.complaints.append(f"thrown: {error}"))
        self.page.on("request", lambda request: self.addresses.append(request.url))
        return self.page

    def _hear(self, message: Any) -> None:
        complaint = f"{urlsplit(message.location['url']).path}: {message.text}"
        if message.type == "error":
            self.complaints.append(complaint)

    def open(self, path: str = "/") -> None:
        """Go to a path of the workbench, and wait until the machine is drawn."""
        self.page.goto("about:blank")
        self.page.goto(self.url + path)
        self.drawn()

    def refused(self, path: str, status: int) -> None:
        """The browser wrote down that a path was refused, and was right to do so."""
        written = [complaint for complaint in self.complaints if complaint.startswith(f"{path}: ")]
        assert written and all(f"status of {status} " in complaint for complaint in written), self.complaints
        self.complaints = [complaint for complaint in self.complaints if complaint not in written]

    def drawn(self) -> None:
        """Wait until the machine is drawn."""
        self.page.wait_for_selector("[data-testid=scene][data-frames]")

    def leave(self) -> None:
        """Close the browser; nothing was complained of, and nothing was asked of anybody else."""
        self.context.close()
        assert not self.complaints, self.complaints
        own = urlsplit(self.url).netloc
        strangers = {urlsplit(address).netloc for address in self.addresses if address.startswith("http")} - {own}
        assert not strangers, strangers

    def __getitem__(self, testid: str) -> Any:
        return self.page.get_by_test_id(testid)

    def text(self, testid: str) -> str:
        """Text of an element."""
        found: str = self[testid].text_content()
        return found

    def see(self, testid: str, text: str | re.Pattern[str]) -> None:
        """Wait until an element says something."""
        api.expect(self[testid]).to_contain_text(text)

    def choose_file(self, testid: str, name: str, data: bytes) -> None:
        """Choose a file in a field."""
        self[testid].set_input_files({"name": name, "mimeType": "application/octet-stream", "buffer": data})

    def drop(self, name: str, data: bytes) -> None:
        """Drop a file on the page."""
        transfer = self.page.evaluate_handle(DROP, [name, base64.b64encode(data).decode()])
        self["drop-zone"].dispatch_event("drop", {"dataTransfer": transfer})

    def fill(self, section: str, **values: object) -> None:
        """Fill in fields of a section of the parameters; None empties one."""
        details = self[f"section-{section}"]
        if details.get_attribute("open") is None:
            details.locator("summary").click()
        for key, value in values.items():
            self[f"field-{section}-{key}"].fill("" if value is None else str(value))

    def generate(self, patience_ms: float = PATIENCE_MS) -> str:
        """Press generate, and wait for the end: the state that the page tells."""
        with self.page.expect_response(lambda answer: answer.request.method == "POST" and answer.url.endswith("/jobs")):
            self["generate"].click()
        return self.ended(patience_ms)

    def ended(self, patience_ms: float = PATIENCE_MS) -> str:
        """Wait until no job is under way; the state that the page tells."""
        api.expect(self["stage"]).to_have_attribute(
            "data-stage", re.compile(r"^state\.(done|failed|judged-bad|cancelled)$"), timeout=patience_ms
        )
        api.expect(self["generate"]).to_be_enabled()
        state: str = self["stage"].get_attribute("data-stage")
        return state.removeprefix("state.")

    def made(self) -> None:
        """Wait until results are shown."""
        api.expect(self["verdict"]).to_be_visible()
        api.expect(self["clock-place"]).not_to_be_empty()

    def job(self) -> str:
        """Id of the job in the page's address."""
        found = re.fullmatch(r"job=([0-9a-f]{32})", urlsplit(self.page.url).fragment)
        assert found, self.page.url
        return found[1]

    def get(self, path: str) -> Any:
        """What the workbench answers to this browser at a path."""
        answer = self.context.request.get(self.url + path)
        assert answer.ok, (path, answer.status)
        return answer

    def download(self, testid: str) -> tuple[str, bytes]:
        """Name and bytes of what a link hands out."""
        with self.page.expect_download() as handed:
            self[testid].click()
        return handed.value.suggested_filename, Path(handed.value.path()).read_bytes()

    def program(self) -> Any:
        """The editor with the program."""
        return self["program"].locator(".cm-scroller")

    def click_line(self, number: int) -> None:
        """Scroll to a line of the program by the wheel, and click into it."""
        scroller = self.program()
        editor = scroller.bounding_box()
        height = scroller.locator(".cm-line").first.bounding_box()["height"]
        now, most = scroller.evaluate("(place) => [place.scrollTop, place.scrollHeight - place.clientHeight]")
        wanted = min(max((number - 1) * height - editor["height"] / 2, 0), most)
        self.page.mouse.move(editor["x"] + editor["width"] / 2, editor["y"] + editor["height"] / 2)
        self.page.mouse.wheel(0, wanted - now)
        for _ in range(100):
            if abs(scroller.evaluate("(place) => place.scrollTop") - wanted) < 2:
                break
            self.page.wait_for_timeout(20)
        gutter = scroller.locator(".cm-gutterElement", has_text=re.compile(rf"^{number}$"))
        gutter.hover()
        place = gutter.bounding_box()
        self.page.mouse.click(place["x"] + place["width"] + 30, place["y"] + place["height"] / 2)

    def axes(self) -> dict[str, str]:
        """What the readout says of every axis."""
        places = self.page.locator("[data-testid^=axis-]")
        found: dict[str, str] = places.evaluate_all(
            "(all) => Object.fromEntries(all.map((one) => [one.dataset.testid.slice(5), one.textContent]))"
        )
        return found

    def picture(self, testid: str) -> Floats:
        """An element as it looks, (height, width, 3), 0 to 255."""
        return np.asarray(Image.open(io.BytesIO(self[testid].screenshot())).convert("RGB"), float)

    def keep(self, name: str) -> None:
        """Keep what the page looks like."""
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SCREENSHOTS / f"{name}.png")


class Camera:
    """What the view shows where, once it is at rest."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self.still()

    def still(self) -> None:
        """Wait until all is drawn in full detail, and no more follows."""
        scene, drawn = self.person["scene"], ""
        while drawn != (drawn := scene.get_attribute("data-frames")):
            self.person.page.wait_for_timeout(300)
            api.expect(scene).to_have_attribute("data-resting", "true")

    def matrix(self) -> Floats:
        """Matrix (4, 4) from metres in `machine` to the view's own coordinates."""
        told: str = self.person["scene"].get_attribute("data-camera")
        return np.array(told.split(), float).reshape(4, 4).T

    def pixel(self, place: Floats) -> tuple[float, float]:
        """Where a place (3,) in metres in `machine` is seen on the page."""
        x, y, _, w = self.matrix() @ np.append(place, 1.0)
        box = self.person["scene"].bounding_box()
        return box["x"] + (1 + x / w) / 2 * box["width"], box["y"] + (1 - y / w) / 2 * box["height"]

    def pixel_size(self, place: Floats, way: Floats) -> float:
        """Millimetres in a way (3,) that a pixel covers at a place."""
        step = np.subtract(self.pixel(place + 1e-3 * way), self.pixel(place))
        return 1.0 / float(np.hypot(*step))

    def approach(self, place: Floats) -> None:
        """Zoom in on a place."""
        self.person.page.mouse.move(*self.pixel(place))
        for _ in range(30):
            self.person.page.mouse.wheel(0, -200)
        self.still()

    def point_at(self, place: Floats) -> None:
        """Point at a place."""
        x, y = self.pixel(place)
        self.person.page.mouse.move(x - 3, y)
        self.person.page.mouse.move(x, y)
        self.person.page.wait_for_timeout(400)
