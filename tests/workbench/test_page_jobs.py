"""The list of jobs on the page: notes, places in the queue, errors, comparisons, and what is brought back."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import time
from typing import Any

import pytest

from tests.helpers.browsing import Person, api
from tests.helpers.paths import ROOT
from tests.helpers.served import Workbench

pytestmark = pytest.mark.browser

EXAMPLE = "flat_panel_00.txt"
COURSES = (ROOT / "examples" / EXAMPLE).read_bytes()


@pytest.fixture
def guest(guest: Person) -> Person:
    """Somebody who has opened the page for the first time."""
    guest.open()
    return guest


def submit(person: Person, data: bytes = COURSES, setup: str = "") -> str:
    """Submit a job as the person; its id."""
    file = {"name": EXAMPLE, "mimeType": "text/plain", "buffer": data}
    form = {"file": file, "kind": "lay", "setup": setup}
    answer = person.context.request.post(f"{person.url}/api/v1/jobs", multipart=form)
    assert answer.status == 202, answer.text()
    return str(answer.json()["id"])


def ended(person: Person, job: str) -> dict[str, Any]:
    """The job when it has ended."""
    while True:
        found: dict[str, Any] = person.get(f"/api/v1/jobs/{job}").json()
        if found["finished_at"]:
            return found
        time.sleep(0.1)


def row(person: Person, job: str) -> Any:
    return person.page.locator(f"[data-testid=job][data-id='{job}']")


def test_what_the_list_tells_of_a_job(guest: Person) -> None:
    good, bad = ended(guest, submit(guest)), ended(guest, submit(guest, b"1\n"))
    slow = ended(guest, submit(guest, setup="[process]\nlay_speed_mm_per_s = 1\n"))
    guest["tab-jobs"].click()
    told = row(guest, good["id"])
    api.expect(told.locator(".duration")).to_have_text(f"{round(good['summary']['duration_s'])} s")
    minutes, seconds = divmod(round(slow["summary"]["duration_s"]), 60)
    hours, minutes = divmod(minutes, 60)
    assert hours
    api.expect(row(guest, slow["id"]).locator(".duration")).to_have_text(f"{hours} h {minutes} min {seconds} s")
    api.expect(told.locator(".input")).to_have_text(hashlib.sha256(COURSES).hexdigest()[:8])
    api.expect(told.locator(".error")).to_have_text("")
    api.expect(row(guest, bad["id"]).locator(".error")).to_contain_text(bad["error"]["detail"].splitlines()[0])
    note = told.get_by_test_id("job-note")
    with guest.page.expect_response(lambda answer: answer.request.method == "PATCH"):
        note.fill("first with the new tape")
        note.press("Enter")
    assert ended(guest, good["id"])["note"] == "first with the new tape"
    guest.page.reload()
    guest["tab-jobs"].click()
    api.expect(row(guest, good["id"]).get_by_test_id("job-note")).to_have_value("first with the new tape")
    guest["language"].select_option("zh")
    api.expect(row(guest, slow["id"]).locator(".duration")).to_have_text(f"{hours} 小时 {minutes} 分 {seconds} 秒")


def test_a_job_that_waits_has_a_place(guest: Person, workbench: Workbench) -> None:
    while not workbench.workers():
        time.sleep(0.05)
    stopped = workbench.workers()
    for worker in stopped:
        os.kill(worker, signal.SIGSTOP)
    running, first, second = (submit(guest) for _ in range(3))
    guest["tab-jobs"].click()
    api.expect(row(guest, first).locator(".state")).to_have_text("Queued, place 1")
    api.expect(row(guest, second).locator(".state")).to_have_text("Queued, place 2")
    # A job that is under way is not deleted without a question.
    row(guest, first).get_by_test_id("job-delete").click()
    guest["answer-keep"].click()
    api.expect(row(guest, first)).to_be_visible()
    row(guest, first).get_by_test_id("job-delete").click()
    guest["answer-delete"].click()
    api.expect(row(guest, first)).to_have_count(0)
    api.expect(row(guest, second).locator(".state")).to_have_text("Queued, place 1")
    guest["job-undo"].click()
    api.expect(row(guest, first).locator(".state")).to_have_text("Cancelled")
    # A note that is being written is not taken away by what is told meanwhile.
    note = row(guest, second).get_by_test_id("job-note")
    note.fill("while it waits")
    for worker in stopped:
        os.kill(worker, signal.SIGCONT)
    assert ended(guest, running)["state"] == ended(guest, second)["state"] == "done"
    guest.page.wait_for_timeout(4000)
    api.expect(note).to_be_focused()
    api.expect(note).to_have_value("while it waits")
    note.press("Enter")
    note.blur()
    api.expect(row(guest, second).locator(".state")).to_have_text("Done")
    assert ended(guest, second)["note"] == "while it waits"


def test_a_deleted_job_is_brought_back(guest: Person) -> None:
    job = submit(guest)
    ended(guest, job)
    guest.open(f"/#job={job}")
    guest.made()
    guest["tab-jobs"].click()
    row(guest, job).get_by_test_id("job-delete").click()
    api.expect(row(guest, job)).to_have_count(0)
    guest.see("undo", f"{EXAMPLE} was deleted")
    api.expect(guest["verdict"]).not_to_be_visible()
    guest["job-undo"].click()
    api.expect(row(guest, job)).to_be_visible()
    guest.made()
    assert guest.job() == job
    api.expect(guest["undo"]).not_to_be_visible()


def test_two_jobs_are_compared(guest: Person) -> None:
    one, two = submit(guest), submit(guest, setup="[process]\nlay_speed_mm_per_s = 100\n")
    first, second = ended(guest, one), ended(guest, two)
    guest["tab-jobs"].click()
    api.expect(guest["jobs-compare"]).to_be_disabled()
    for job in (one, two):
        row(guest, job).get_by_test_id("job-tick").check()
    guest["jobs-compare"].click()
    api.expect(guest["comparison"]).to_be_visible()
    tables = guest["comparison"].locator("table")
    heads = tables.first.locator("th").all_text_contents()
    assert heads == [f"{EXAMPLE} · {one[:8]}", f"{EXAMPLE} · {two[:8]}"]
    changed = tables.first.locator("tbody tr")
    api.expect(changed).to_have_count(1)
    assert changed.locator("td").all_text_contents()[1:] == ["250", "100"]
    guest.see("comparison", "Files that differ: none")
    durations = tables.nth(1).locator("tr", has_text=re.compile(r"^duration"))
    lasting = [divmod(round(job["summary"]["duration_s"], 1), 60) for job in (first, second)]
    said = durations.first.locator("td").all_text_contents()[1:]
    assert said == [f"{minutes:.0f} min {rest:.1f} s" if minutes else f"{rest:.1f} s" for minutes, rest in lasting]
    guest["language"].select_option("zh")
    guest.see("comparison", "不同的文件: 无")


@pytest.mark.parametrize("job", ["unknown", "0" * 32, "a/b?c"])
def test_a_link_to_no_job_says_so(guest: Person, job: str) -> None:
    guest.page.goto("about:blank")
    guest.page.goto(f"{guest.url}/#job={job}")
    api.expect(guest["problem"]).to_have_attribute("data-code", "not-found")
    guest.see("problem", "there is no job" if len(job) != 5 else "there is nothing at")
    api.expect(guest["loading"]).to_be_empty()
    assert guest.complaints and all("404" in complaint for complaint in guest.complaints)
    guest.complaints.clear()


def test_a_link_says_that_it_loads(guest: Person, workbench: Workbench) -> None:
    job = submit(guest)
    ended(guest, job)
    held = []
    guest.page.route(f"**/api/v1/jobs/{job}", lambda route: held.append(route))
    guest.page.goto("about:blank")
    guest.page.goto(f"{guest.url}/#job={job}")
    guest.see("loading", f"Loading job {job[:8]} …")
    api.expect(guest.page.get_by_text("Choose or drop a file")).not_to_be_visible()
    while not held:
        guest.page.wait_for_timeout(50)
    held[0].continue_()
    guest.made()
    api.expect(guest["loading"]).to_be_empty()
