"""What the tests of the page share: a browser, a workbench of each module's own, and somebody new to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.helpers.served import Workbench

if TYPE_CHECKING:
    from tests.helpers.browsing import Person


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    # Where playwright is missing, only the tests of the page are skipped.
    from tests.helpers.browsing import chromium

    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory, browser: Any) -> Iterator[Workbench]:
    with Workbench(tmp_path_factory.mktemp("work"), "--workers", 1) as workbench:
        yield workbench


@pytest.fixture
def guest(browser: Any, workbench: Workbench) -> Iterator[Person]:
    """Somebody who has not been here before."""
    from tests.helpers.browsing import Person

    person = Person(browser, workbench.url)
    yield person
    person.leave()
