"""Products: the files that a job made, opened for whoever asks for them, or why there are none."""

from __future__ import annotations

from io import BufferedReader
from typing import cast

from tapelayer.jobs.kind import Product
from tapelayer.jobs.kinds import KindName, kind_of, kinds
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import Store

# Folder of the results in a job's folder.
OUT = "out"


def products() -> dict[str, Product]:
    """Return what jobs make, by name.

    Examples:
        >>> {name: product.file for name, product in products().items()}
        {'program': 'program.nc', 'courses': 'courses.txt'}
    """
    return {kind.product.name: kind.product for kind in kinds()}


def product_of(record: Record) -> Product:
    """Return what a job makes."""
    return kind_of(cast(KindName, record.kind)).product


def open_product(store: Store, record: Record) -> BufferedReader:
    """Open the product of a job, which is given only where it was judged good.

    Raises:
        Problem: it is withheld, or there is none; the problem says why.
    """
    product = product_of(record)
    if record.error and record.error["code"] == "verification-failed":
        evidence = {key: record.error[key] for key in ("failures", "failure_count") if key in record.error}
        detail = f"verification judged the {product.name} bad: {record.error['detail']}"
        raise Problem(f"{product.name}-withheld", detail, **evidence)
    return open_result(store, record, product.file)


def open_result(store: Store, record: Record, name: str) -> BufferedReader:
    """Open a file among a job's results.

    Raises:
        Problem: there is no such file; the problem says why.
    """
    if not record.ended:
        raise Problem("job-not-finished", "the job is under way; follow its events and ask again when it is done")
    # Files left by a killed worker are not results.
    if record.summary is None:
        reason = record.error["detail"] if record.error else record.state
        raise Problem("job-failed", f"the job made nothing: {reason}")
    if store.holds(record.id, OUT, name):
        return store.open(record.id, OUT, name)
    raise Problem("not-made", f"this job has none: it is of kind {record.kind}")
