"""Text: the bytes of a file in whatever encoding and line ends, as UTF-8 lines that end with LF."""

from __future__ import annotations

import codecs
import re

from tapelayer.errors import InputFault, InputRefused

# The mark of UTF-32 begins with that of UTF-16. GB18030 keeps ASCII, and what else it holds stands in comments.
_MARKS = (
    (codecs.BOM_UTF8, ""),
    (b"\x84\x31\x95\x33", ""),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_WIDE = ("utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be")
_SAMPLE = 4096  # bytes from which an encoding without a mark is told, a multiple of four
_TAIL = 1024  # bytes at the end in which an end mark is looked for: DOS pads a record with it
_END_MARK = re.compile(rb"\x1a[\x1a\0\s]*\Z")
_CONTROL = re.compile("[\0-\x08\x0e-\x19\x1b-\x1f\x7f]")


def plain_text(data: bytes, name: str, refused: type[InputRefused]) -> bytes:
    r"""Return the text of a file without its mark, in UTF-8 or another encoding that keeps ASCII, lines ended by LF.

    UTF-16 and UTF-32 are told by their mark, or by their beginning; a last Ctrl-Z, the end mark of DOS, is no text.
    Lines keep their numbers. Plain text is returned as it is, without a copy.

    Args:
        data: the file's bytes.
        name: the file as the user named it.
        refused: error to raise with the fault.

    Raises:
        InputRefused: `refused`, where the bytes after a mark of UTF-16 or UTF-32 are not of that encoding.

    Examples:
        >>> plain_text("\ufeff1\r\nstart\r\n\x1a".encode("utf-16-le"), "one.txt", InputRefused)
        b'1\nstart\n'
    """
    text = _narrow(data, name, refused)
    if b"\x1a" in text[-_TAIL:] and (end := _END_MARK.search(text, max(len(text) - _TAIL, 0))):
        text = text[: end.start()]
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return text


def beginning(data: bytes) -> str:
    r"""Return the text that the first bytes of a file begin, its lines ended by LF; they may end within a character.

    Bytes that are no text in UTF-8, UTF-16 or UTF-32 stand as replacement characters.

    Examples:
        >>> beginning("\ufeff1\r\nstart".encode("utf-16-le")[:-1])
        '1\nstar\ufffd'
    """
    mark, encoding = _encoding(data)
    text = data.removeprefix(mark).decode(encoding or "utf-8", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _narrow(data: bytes, name: str, refused: type[InputRefused]) -> bytes:
    """Return the bytes without their mark, in an encoding that keeps ASCII."""
    mark, encoding = _encoding(data)
    body = data.removeprefix(mark)
    if not encoding:
        return body
    try:
        return body.decode(encoding).encode()
    except UnicodeDecodeError as error:
        shown, byte = encoding[:6].upper(), error.start + len(mark)
        sentence = f"the file is in {shown}, but its byte {byte} is not; it is damaged or cut short: save it as UTF-8"
        raise refused(name, [InputFault(0, sentence)]) from None


def _encoding(data: bytes) -> tuple[bytes, str]:
    """Return the mark that the bytes begin with, and their encoding; empty where it is one that keeps ASCII."""
    return next((known for known in _MARKS if data.startswith(known[0])), (b"", _unmarked(data[:_SAMPLE])))


def _unmarked(sample: bytes) -> str:
    """Return the encoding of text in UTF-16 or UTF-32 by its beginning; empty for any other bytes."""
    # No text in another encoding has a zero byte.
    if b"\0" not in sample:
        return ""
    for encoding in _WIDE:
        width = 2 if encoding.startswith("utf-16") else 4
        try:
            text = codecs.getincrementaldecoder(encoding)().decode(sample)
        except UnicodeDecodeError:
            continue
        # Bytes in the wrong order are text as well, but not of ASCII.
        ascii_share = sum(map(str.isascii, text)) * width / len(sample)
        if ascii_share > 0.5 and not _CONTROL.search(text):
            return encoding
    return ""
