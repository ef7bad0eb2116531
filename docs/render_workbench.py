"""Render docs/workbench.png and docs/workbench_spray.png: screenshots of the page, served by a temporary workbench.

`pip install -e '.[docs]'`, put Chromium on the path, then `python docs/render_workbench.py`.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright
from render_machine import PART_ORIGIN, slab

HERE = Path(__file__).parent
COMMAND = (sys.executable, "-c", "from tapelayer.dispatch import main; main()", "serve", "--port", "0", "--no-open")
# The 3D view is rendered on the CPU, so no display is needed.
ARGUMENTS = ("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1600, "height": 900}
PATIENCE_MS = 120_000
SHARE = 0.6


def main() -> None:
    """Start a workbench and a browser, run both examples, and save their screenshots."""
    with tempfile.TemporaryDirectory() as work, served(Path(work)) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=[*ARGUMENTS])
        laying = opened(browser, url)
        laying.get_by_test_id("import-mould").set_input_files(
            {"name": "mould.stl", "mimeType": "model/stl", "buffer": mould()}
        )
        made(laying, "cylinder_panel_15.txt")
        turned(laying, 100, 0)
        save(laying, "workbench.png")
        spraying = opened(browser, url)
        made(spraying, "curved_panel.stl")
        spraying.get_by_test_id("tab-plots").click()
        save(spraying, "workbench_spray.png")
        browser.close()


@contextmanager
def served(work: Path) -> Iterator[str]:
    """Serve a workbench on a free port and yield its address."""
    process = subprocess.Popen([*COMMAND, "--work-dir", str(work)], stdout=subprocess.PIPE, text=True)
    assert process.stdout
    line = process.stdout.readline()
    try:
        if not line.startswith("workbench: http"):
            raise RuntimeError("the workbench does not start; its stderr says why")
        yield line.split()[1]
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def opened(browser: Browser, url: str) -> Page:
    """Open the page in light colours and English, and return it once its machine is drawn."""
    page = browser.new_context(viewport=SIZE, locale="en-GB", color_scheme="light").new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(url)
    page.wait_for_selector("[data-testid=scene][data-frames]")
    return page


def made(page: Page, example: str) -> None:
    """Generate an example and move its clock to the time of the picture."""
    expect.set_options(timeout=PATIENCE_MS)
    page.get_by_test_id("example-select").select_option(example)
    expect(page.get_by_test_id("file-name")).to_have_text(example)
    page.get_by_test_id("generate").click()
    expect(page.get_by_test_id("verdict")).to_contain_text("PASSED")
    page.get_by_test_id("scrub").evaluate(
        f"(bar) => {{ bar.value = {SHARE} * bar.max; bar.dispatchEvent(new Event('input')); }}"
    )


def turned(page: Page, across: int, down: int) -> None:
    """Turn the view by dragging it so many pixels, and zoom out a little."""
    box = page.get_by_test_id("scene").bounding_box()
    assert box
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + across, y + down, steps=8)
    page.mouse.up()
    page.mouse.move(x, y)
    page.mouse.wheel(0, 400)
    page.mouse.move(2, 2)


def mould() -> bytes:
    """Return the cylinder panel's mould as an STL in mm, in the part's axes."""
    mesh = slab(np.linspace(0.0, 1.0, 65), np.linspace(-0.06, 1.56, 2), -0.025, 0.0)
    mesh.apply_translation(-np.array(PART_ORIGIN))
    mesh.apply_scale(1000.0)
    data: bytes = mesh.export(file_type="stl")
    return data


def save(page: Page, name: str) -> None:
    """Wait until the view is drawn in full detail, and save a screenshot."""
    page.wait_for_timeout(4000)
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(HERE / name, optimize=True)


if __name__ == "__main__":
    main()
