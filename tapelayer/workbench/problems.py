"""Problems: the errors that the API answers, as problem details (RFC 9457)."""

from __future__ import annotations

import re
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tapelayer.errors import InputFault, InputRefused, TapelayerError, VerificationFailed
from tapelayer.language import OTHERS
from tapelayer.sentences import translated
from tapelayer.verification.failures import Outcome

MEDIA_TYPE = "application/problem+json"
# A job's state is sent and stored often, so a problem lists only the first places; the report lists all.
SHOWN_PLACES = 100
SHOWN_FAULTS = 20
# What the places of a validation error begin with, by the part of the request.
PARTS = ("body", "query", "path", "header", "cookie")


@dataclass(frozen=True)
class ProblemKind:
    """Meaning of a problem's code.

    Attributes:
        status: HTTP status of the response.
        title: the same for every problem with this code.
        meaning: what it means and what to do, in full sentences.
    """

    status: int
    title: str
    meaning: str


CODES: dict[str, ProblemKind] = {
    # Refusals by the library; the code is the error's name.
    "input-refused": ProblemKind(422, "A file is refused", "The faults name each line and what is wrong with it."),
    "course-file-refused": ProblemKind(
        422, "The course file cannot be read", "The faults name each line and what is wrong with it; mend the file."
    ),
    "setup-refused": ProblemKind(
        422, "The setup cannot be used", "The faults name the keys and values that are wrong, and what is allowed."
    ),
    "ply-refused": ProblemKind(
        422, "The ply cannot be used", "The faults name the keys and values that are wrong, and what is allowed."
    ),
    "controller-refused": ProblemKind(
        422, "The controller table cannot be used", "The faults name what is wrong in the table."
    ),
    "program-refused": ProblemKind(
        422,
        "The NC program cannot be read",
        "The faults name each line that the controller table does not know.",
    ),
    "program-of-other-setup": ProblemKind(
        409,
        "The program is made for another setup",
        "Its header names another setup: send that one, or force judging it by this one.",
    ),
    "mesh-refused": ProblemKind(
        422, "The model cannot be used", "The STL is no STL, is empty, or holds no usable surface."
    ),
    "footprint-refused": ProblemKind(
        422, "The measured footprint cannot be used", "The faults name each line and what is wrong with it."
    ),
    "pitch-not-found": ProblemKind(
        422, "No pitch is even enough", "No pitch keeps the coating as even as asked for: state one, or ask for less."
    ),
    "model-refused": ProblemKind(
        422,
        "The URDF cannot serve as the machine",
        "A joint or frame is missing, has the wrong type, or is out of place.",
    ),
    "configuration-refused": ProblemKind(
        422, "Axis values cannot be evaluated", "The columns are not the machine's axes, or a value is not finite."
    ),
    "axis-beyond-travel": ProblemKind(
        422,
        "An axis would leave its travel",
        "The worst place of each axis is named: move the part, or check the travel in the setup.",
    ),
    "tape-runs-back": ProblemKind(
        422, "The tape would run back", "The tape would run back under the shoe: look at the course where it turns."
    ),
    "part-too-high": ProblemKind(
        422, "The part is too high", "The head at the top of its travel is not above the part: lower the part."
    ),
    "pose-undefined": ProblemKind(
        422, "A point has no roller pose", "The tangent is parallel to the normal, or the roller axis is vertical."
    ),
    "tape-wider-than-travel": ProblemKind(
        422, "The tape is too wide", "The tape with the knives' clearance is wider than a slide travels."
    ),
    "blades-meet": ProblemKind(422, "The blades would meet", "The blades are longer than the knives' pitch."),
    "courses-refused": ProblemKind(422, "Courses cannot be cut", "Each course is named with what is wrong."),
    "cut-angle-too-small": ProblemKind(
        422, "A cut is too flat", "A cut lies flatter to the tape than the head may cut; the courses are named."
    ),
    "cuts-cross": ProblemKind(
        422, "Cuts cross", "A course's own two cut lines cross inside the tape; it is too short."
    ),
    "course-longer-than-roll": ProblemKind(
        422, "A course is longer than a roll", "A course needs more tape than a new roll holds."
    ),
    "beyond-surface": ProblemKind(
        422, "A course leaves the mould", "A course runs where the mould's smooth surface ends; extend the mould."
    ),
    "no-natural-paths": ProblemKind(
        422,
        "Natural paths do not fill the ply",
        "The mould is so strongly curved that courses go round in the ply, or come together; split the ply.",
    ),
    "path-not-found": ProblemKind(
        422, "The mould is too rough for a course", "No path can be traced on the mould's smooth surface there."
    ),
    "nothing-to-spray": ProblemKind(
        422, "There is nothing to spray", "Nothing of the surface can be reached by the gun."
    ),
    "part-beyond-reach": ProblemKind(
        422, "The part lies beyond reach", "Most of the surface lies where the gun does not reach it."
    ),
    "not-writable": ProblemKind(
        422, "The control cannot say it", "The trajectory cannot be said in the control's words, for the reason given."
    ),
    "verification-failed": ProblemKind(
        422,
        "Verification failed",
        "The program was made and judged bad, so it is withheld; the report names every failure and its line.",
    ),
    "target-not-writable": ProblemKind(
        500, "A file cannot be written", "The server could not write a result; its disk may be full."
    ),
    "work-directory-refused": ProblemKind(
        500, "The work directory cannot be used", "The server cannot use its work directory; tell its operator."
    ),
    "serve-refused": ProblemKind(
        500, "The server cannot start", "An option or file that it was started with is wrong."
    ),
    # Refusals by the server.
    "not-found": ProblemKind(
        404, "There is no such thing", "Nothing has this address; a job may have expired or been removed."
    ),
    "method-not-allowed": ProblemKind(
        405, "The method is not allowed", "The header Allow names the methods of this address."
    ),
    "not-owner": ProblemKind(
        403, "This is somebody else's job", "Whoever has a job's id may read it; only its owner may change it."
    ),
    "queue-full": ProblemKind(429, "The queue is full", "Try again after the seconds in the header Retry-After."),
    "upload-too-large": ProblemKind(413, "Too much was sent", "The limit is named; the server's operator sets it."),
    "unsupported-media-type": ProblemKind(
        415, "The media type is not supported", "The type that is expected is named."
    ),
    "invalid-request": ProblemKind(
        422, "The request is not valid", "The faults name the field, what was expected and what was sent."
    ),
    "name-not-allowed": ProblemKind(
        422,
        "A name is not allowed",
        "Over HTTP, files are named plainly: by the name of a built-in, or of a file sent with the same request.",
    ),
    "xml-refused": ProblemKind(422, "The XML is refused", "It is no XML, or declares a document type or entities."),
    "host-not-allowed": ProblemKind(
        421, "The server does not go by this name", "Use a name it knows, or start it with --allow-host NAME."
    ),
    "foreign-origin": ProblemKind(
        403, "Another site's page asked for this", "Only the server's own page, or a program without one, may do this."
    ),
    "token-required": ProblemKind(
        401, "A token is required", "Send the header Authorization: Bearer TOKEN, or sign in on the page."
    ),
    "wrong-token": ProblemKind(401, "The token is wrong", "Ask the server's operator for the token."),
    "too-many-attempts": ProblemKind(
        429, "Too many wrong tokens", "Try again after the seconds in the header Retry-After."
    ),
    # Outcomes of jobs.
    "job-not-finished": ProblemKind(409, "The job is under way", "Follow its events, and ask again when it is done."),
    "job-failed": ProblemKind(409, "The job failed", "The job has no such result; its error says why."),
    "program-withheld": ProblemKind(
        409, "The program is withheld", "Verification judged it bad; the report and the poses show where."
    ),
    "courses-withheld": ProblemKind(
        409, "The courses are withheld", "They do not keep the ply's limits; the report and the maps show where."
    ),
    "not-made": ProblemKind(404, "This kind of job has none", "The result belongs to another kind of job."),
    "cancelled": ProblemKind(409, "The job was cancelled", "Its owner cancelled it; submit it again to run it."),
    "server-stopped": ProblemKind(503, "The server was stopped", "The job was under way then; submit it again."),
    "out-of-memory": ProblemKind(
        500, "The job needs too much memory", "Thin the points or the triangles out, or split the job."
    ),
    "out-of-time": ProblemKind(
        500, "The job takes too long", "Thin the points or the triangles out, or split the job."
    ),
    "worker-killed": ProblemKind(500, "The job's process was killed", "Only this job is lost; submit it again."),
    "internal": ProblemKind(
        500, "Something went wrong in the server", "Tell the server's operator the reference; the log has the rest."
    ),
}

# Problems that any route may answer.
EVERYWHERE = (
    "token-required",
    "wrong-token",
    "too-many-attempts",
    "host-not-allowed",
    "invalid-request",
    "internal",
    "server-stopped",
)


class Problem(Exception):
    """A client's request cannot be fulfilled.

    Args:
        code: one of `CODES`.
        detail: what is wrong this time, for a person.
        headers: of the response.
        evidence: further members of the body.
    """

    def __init__(self, code: str, detail: str, headers: Mapping[str, str] | None = None, **evidence: Any) -> None:
        self.code, self.detail, self.evidence = code, detail, evidence
        self.headers = dict(headers or {})
        self.kind = CODES[code]
        super().__init__(detail)

    @property
    def status(self) -> int:
        """HTTP status of the response."""
        return self.kind.status

    def body(self) -> dict[str, Any]:
        """Return the problem as plain values for JSON, its detail in the other languages beside the English."""
        return {
            "type": f"/problems/{self.code}",
            "title": self.kind.title,
            "status": self.status,
            "detail": self.detail,
            "translations": translations(self.detail),
            "code": self.code,
            **self.evidence,
        }


def translations(sentence: str) -> dict[str, str]:
    """Return a sentence in each other language that has it, by the language's code.

    Examples:
        >>> translations("the job was cancelled")
        {'zh': '任务已取消'}
    """
    told = {language: translated(sentence, language) for language in OTHERS}
    return {language: other for language, other in told.items() if other != sentence}


def internal() -> Problem:
    """Return the problem for a bug of ours; its evidence has the `reference` to look up in the server's log."""
    reference = secrets.token_hex(4)
    sentence = f"something went wrong in the server; its log tells more under the reference {reference}"
    return Problem("internal", sentence, reference=reference)


def not_valid(errors: Sequence[Mapping[str, Any]]) -> Problem:
    """Return the problem for what does not fit a model, from the errors of its validation."""
    sentences = [f"{_place(error['loc'])}: {error['msg']}" for error in errors]
    faults = [
        {"line": 0, "column": 0, "sentence": sentence, "translations": translations(sentence)}
        for sentence in sentences[:SHOWN_FAULTS]
    ]
    detail = "\n".join(sentences[:SHOWN_FAULTS])
    return Problem("invalid-request", detail, faults=faults, fault_count=len(sentences))


# Members of a problem that it makes itself.
REBUILT = ("type", "title", "status", "detail", "translations", "code")


def problem_of_body(body: Mapping[str, Any]) -> Problem:
    """Return the problem that has this body, as a worker tells it."""
    evidence = {key: value for key, value in body.items() if key not in REBUILT}
    return Problem(body["code"], body["detail"], **evidence)


def responses(*codes: str) -> dict[int | str, dict[str, Any]]:
    """Return OpenAPI's descriptions of these problems as responses of a route, by status."""
    schema = {"$ref": "#/components/schemas/ProblemDetails"}
    by_status: dict[int | str, dict[str, Any]] = {}
    for code in codes:
        kind = CODES[code]
        response = by_status.setdefault(kind.status, {"description": "", "content": {MEDIA_TYPE: {"schema": schema}}})
        response["description"] = f"{response['description']}\n\n`{code}`: {kind.meaning}".strip()
    return by_status


def problem_of(error: TapelayerError) -> Problem:
    """Return an error of the library as a problem, with its faults or failures."""
    evidence: dict[str, Any] = {}
    if isinstance(error, InputRefused):
        evidence["faults"] = [_fault(fault) for fault in error.faults[:SHOWN_PLACES]]
        evidence["fault_count"] = len(error.faults)
    if isinstance(error, VerificationFailed) and isinstance(error.evidence, Outcome):
        evidence["failures"] = [failure.values() for failure in error.evidence.failures[:SHOWN_PLACES]]
        evidence["failure_count"] = len(error.evidence.failures)
    return Problem(code_of(type(error)), str(error), **evidence)


def of_error(error: TapelayerError) -> dict[str, Any]:
    """Return an error of the library as plain values for JSON."""
    return problem_of(error).body()


def code_of(error: type[TapelayerError]) -> str:
    """Return the code of a class of errors: its name in lower case with hyphens."""
    return re.sub(r"(?<!^)(?=[A-Z])", "-", error.__name__).lower()


def _place(location: Sequence[str | int]) -> str:
    """Return a location in a request as text, as in values[3][0]."""
    parts = location[1:] if location[0] in PARTS and location[1:] else location
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def _fault(fault: InputFault) -> dict[str, Any]:
    values: dict[str, Any] = {
        "line": fault.line,
        "column": fault.column,
        "sentence": fault.sentence,
        "translations": translations(fault.sentence),
    }
    if fault.place:
        values["section"], values["key"] = fault.place[0], ".".join(fault.place[1:2])
    return values
