"""Every sentence that the source can say has its translation, and a finished sentence becomes it."""

from __future__ import annotations

import ast
import errno
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pydantic_core import _pydantic_core

from tapelayer.errors import AxisBeyondTravel, CourseFileRefused, InputFault, InputRefused
from tapelayer.jobs.kinds import kinds
from tapelayer.language import OTHERS, Language
from tapelayer.reporting.failure_names import failure_name, worded
from tapelayer.reporting.quantity import Group, Quantity
from tapelayer.reporting.words import Say
from tapelayer.sentences import PLACE, catalogue, translated
from tapelayer.verification.failures import Failure
from tests.helpers.paths import ROOT
from tests.helpers.said import modules, sayings, templates, texts

LANGUAGES = OTHERS
# Sentences that the source puts together from single words, and those of other programs.
COMPOSED = {"course {1} point {2}", "pass {1}", "pass {1} point {2}", "point {1}"}
ALIEN = ("libraries", "failures")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("module", modules())
def test_every_sentence_has_its_translation(module: str, language: Language) -> None:
    """A sentence without one goes into a file of tapelayer/languages, with {1}, {2} for what the source puts in."""
    entries = catalogue(language)
    missing = {f"{module}:{line}": text for text, line in sayings(module).items() if text not in entries}
    assert not missing


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_entry_is_said_somewhere(language: Language) -> None:
    said = COMPOSED.union(*(texts(ROOT / module) for module in modules()))
    for path in (ROOT / "tapelayer" / "languages" / language).glob("*.toml"):
        if path.stem not in ALIEN:
            assert tomllib.loads(path.read_text("utf-8")).keys() <= said, path.name


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_translation_uses_every_value_once(language: Language) -> None:
    for english, other in catalogue(language).items():
        numbers = [int(place[1]) for place in PLACE.finditer(english)]
        assert numbers == list(range(1, len(numbers) + 1)), english
        assert sorted(int(place[1]) for place in PLACE.finditer(other)) == numbers, english
        assert other.strip() and other == other.strip(), english


def _filled(text: str) -> str:
    return PLACE.sub(lambda place: f"<{place[1]}>", text)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_finished_sentence_becomes_its_own_translation(language: Language) -> None:
    """No other template takes the sentence, and none mixes up its values."""
    for english, other in catalogue(language).items():
        # Values that no template holds, and that no list separates.
        told = translated(_filled(english), language)
        wanted = _filled(other)
        # Two places side by side share what they hold.
        assert told == wanted or "}{" in english, english


@pytest.mark.parametrize("language", LANGUAGES)
def test_words_of_tomllib_are_known(language: Language) -> None:
    source = ast.parse(Path(tomllib._parser.__file__).read_text("utf-8"))  # type: ignore[attr-defined]
    calls = [node for node in ast.walk(source) if isinstance(node, ast.Call)]
    raising = [call for call in calls if ast.unparse(call.func) in ("suffixed_err", "TOMLDecodeError")]
    words = {text.lower() for call in raising for argument in call.args[-1:] for text in templates(argument)}
    words = {text for text in words if re.match("[a-z]", text)}
    assert len(words) > 10
    assert words <= catalogue(language).keys()


REACHED = (
    *("float_type", "finite_number", "int_type", "string_type", "bool_type", "list_type", "dict_type", "model_type"),
    *("greater_than", "greater_than_equal", "less_than", "less_than_equal", "literal_error", "too_short", "too_long"),
    *("string_too_short", "string_too_long", "string_pattern_mismatch", "tuple_type", "float_parsing"),
    *("int_parsing", "int_from_float"),
)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("kind", REACHED)
def test_words_of_pydantic_are_known(kind: str, language: Language) -> None:
    known = {error["type"]: error for error in _pydantic_core.list_all_errors()}
    text = known[kind]["message_template_python"].replace("{field_type}", "List").replace("{expected_plural}", "s")
    sentence = re.sub(r"\{\w+\}", "7", text[0].lower() + text[1:])
    assert not re.search(r"[a-z]{3,} [a-z]{3,}", translated(sentence, language)), sentence


@pytest.mark.parametrize(
    "number",
    [
        *(errno.ENOENT, errno.EACCES, errno.EISDIR, errno.ENOTDIR, errno.EEXIST, errno.ENOSPC, errno.EROFS),
        *(errno.ENAMETOOLONG, errno.ELOOP, errno.EIO, errno.EMFILE, errno.EDQUOT, errno.EPERM),
        *(errno.EADDRINUSE, errno.EADDRNOTAVAIL),
    ],
)
def test_words_of_the_system_are_known(number: int) -> None:
    refused = InputRefused.unreadable("panel.txt", OSError(number, os.strerror(number)))
    assert re.fullmatch(r"panel\.txt: 无法读取：[^a-z]+", translated(str(refused), "zh"))


def test_english_stays_as_it_is() -> None:
    sentence = "panel.txt:7: the file is empty; export the courses again"
    assert translated(sentence, "en") is sentence


@pytest.mark.parametrize("text", ["", "a: b: c", "no entry has this", "x and y but not z", "'a: the file is empty'"])
def test_what_no_template_fits_stays_as_it_is(text: str) -> None:
    assert translated(text, "zh") == text


class Heading:
    name, revolute, lower, upper = "c", True, -0.5235987755982988, 0.5235987755982988


def test_errors_of_many_lines() -> None:
    advice = "move the part with [part] l1_mm, l2_mm, l3_mm, or lower [process] approach_mm"
    error = AxisBeyondTravel([(15, 92, Heading(), 0.787)], advice)
    assert translated(str(error), "zh").splitlines() == [
        "道次 15 点 92：c 轴将位于 45.092 deg，超出其限位 30 deg（行程 -30 至 30）",
        "请用 [part] l1_mm、l2_mm、l3_mm 移动零件，或减小 [process] approach_mm",
    ]


def test_sentences_within_sentences() -> None:
    fault = InputFault(
        4, "course 5, point 1: expected a finite number for x, arc length, got 'nan', '-'; correct or remove the point"
    )
    refused = CourseFileRefused("part and ply.txt", [fault] * 22)
    told = translated(str(refused), "zh").splitlines()
    assert told[0] == "part and ply.txt:4: 道次 5，点 1：x、弧长应为有限数，实为 'nan', '-'；请改正或删去该点"
    assert told[-1] == "part and ply.txt: 另有 2 处错误"


def test_the_sentence_with_the_most_words_of_its_own_is_meant() -> None:
    """Names before a sentence do not lead to one that fits it less, nor into the values of one."""
    number = (
        "expected a course number (a whole number from 1, of at most 9 digits) alone on its line before `start`, "
        "got '%'; give each course a number and close it with `end`"
    )
    assert translated(f"my: base.nc:1: {number}", "zh") == (
        "my: base.nc:1: `start` 之前应有单独成行的道次号（从 1 起的整数，最多 9 位），"
        "实为 '%'；请为每个道次编号并以 `end` 结束"
    )
    assert translated("a folder/job.toml:3: [tape] width_mm is missing", "zh") == (
        "a folder/job.toml:3: 缺少 [tape] width_mm"
    )
    assert translated("setup: [process] kinematics: input should be 'a' or 'b', got 'c: d'", "zh") == (
        "setup: [process] kinematics: 应为 'a' 或 'b'，实为 'c: d'"
    )
    assert translated("output: cannot be read: permission denied", "zh") == "output: 无法读取：没有权限"


def test_lists_of_names() -> None:
    assert translated("the program does not end with M30 or M02; it may be cut off", "zh") == (
        "程序没有以 M30 或 M02 结束；可能被截断"
    )


def test_a_phrase_with_the_signs_of_a_list_is_no_list() -> None:
    phrase = "table.toml:30: blocks.restated[0]: expected printable ASCII signs, and not blanks alone, got ' '"
    assert translated(phrase, "zh") == (
        "table.toml:30: blocks.restated[0]: 应为 可打印的 ASCII 字符，且不得只有空格，实为 ' '"
    )
    lost = (
        "p.stl: no pass can be sprayed on it: of the surface 2 cm2 too steep, 3 cm2 hidden; turn the part or place it "
    )
    assert "2 cm2 过陡，3 cm2 被遮挡；" in translated(f"{lost}elsewhere", "zh")


def test_failures_in_words() -> None:
    assert translated(Failure(5, 51, "courses_laid", 3, 4, 12).sentence(), "zh") == (
        "第 12 行: 道次 5 点 51: 已铺道次数为 3，限值 4"
    )
    assert translated(Failure(2, 3, "axis_c_deg", 31.5, 30, of="pass").sentence(), "zh") == (
        "喷涂道次 2 点 3: c 轴位置（deg）为 31.5，限值 30"
    )


def _ends(folder: Path, *arguments: str, **environment: str) -> tuple[int, str]:
    """Exit code and standard error of a command in a folder."""
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", *arguments]
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("LC_")}
    around = inherited | {"PYTHONPATH": str(ROOT), "NO_COLOR": "1"} | environment
    done = subprocess.run(command, cwd=folder, capture_output=True, env=around, timeout=120, check=False)
    return done.returncode, done.stderr.decode("utf-8")


def test_the_terminal_says_it_in_the_language_of_its_locale(tmp_path: Path) -> None:
    (tmp_path / "panel.txt").write_bytes(b"")
    wrong = ("export", "panel.txt")
    assert _ends(tmp_path, *wrong, LANG="zh_CN.UTF-8", PYTHONUTF8="1") == (
        2,
        "panel.txt: 文件为空；请重新导出道次\n",
    )
    english = "panel.txt: the file is empty; export the courses again\n"
    assert _ends(tmp_path, *wrong, LANG="C.UTF-8") == (2, english)
    assert _ends(tmp_path, *wrong, LANG="zh_CN.UTF-8", PYTHONIOENCODING="ascii") == (2, english)


# Names of failures with the unit at their end, as the judges give them.
NAME = re.compile(r"(?:[a-z]+|\{\d\})(?:_(?:[a-z0-9]+|\{\d\}))+")
JUDGING = re.compile(
    r"tapelayer/(?:verification|laying|spraying)/(?:axis_use|stated_axes|switching|inspection|\w+_check)\.py"
)
# What the judges name beside failures, and composed names whose parts are all known.
NO_FAILURE = {"max_speed", "speed_limit", "knife_1", "knife_2", "auxiliary_roller", "heater_on", "heater_off"}
NO_FAILURE |= {"max_acceleration", "acceleration_limit", "max_jerk", "jerk_limit"}
NO_FAILURE |= {"max_heading_error_deg", "max_roller_tilt_deg"}
PARTS = {
    "{1}_words": ("heater_on_words", "heater_off_words"),
    "{1}_astray_ms": ("heater_on_astray_ms", "heater_off_astray_ms"),
    "auxiliary_roller_{1}_words": ("auxiliary_roller_down_words", "auxiliary_roller_up_words"),
    "auxiliary_roller_{1}_mm": ("auxiliary_roller_down_mm", "auxiliary_roller_up_mm"),
    "axis_{1}": (),
    "{1}_{2}": ("axis_{1}_mm", "axis_{1}_deg"),
    "{1}_speed_{2}_per_s": ("axis_{1}_speed_mm_per_s", "axis_{1}_speed_deg_per_s"),
    "{1}_acceleration_{2}_per_s2": ("axis_{1}_acceleration_mm_per_s2", "axis_{1}_acceleration_deg_per_s2"),
    "{1}_jerk_{2}_per_s3": ("axis_{1}_jerk_mm_per_s3", "axis_{1}_jerk_deg_per_s3"),
    "{1}_with_{2}_on": ("rapid_with_{1}_on", "stop_with_{1}_on", "pause_with_{1}_on"),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_failure_has_its_name(language: Language) -> None:
    judging = [module for module in modules() if JUDGING.fullmatch(module)]
    names = {text for module in judging for text in texts(ROOT / module) if NAME.fullmatch(text)} - NO_FAILURE
    assert len(names) > 30
    assert {whole for name in names for whole in PARTS.get(name, (name,))} <= catalogue(language).keys()


def test_a_failure_has_one_name_in_the_report_on_the_page_and_in_the_terminal() -> None:
    entries = catalogue("zh")
    rows = [row for kind in kinds() for row in kind.rows if isinstance(row, Quantity) and row.group is Group.ERROR]
    names: dict[str, set[str]] = {}
    for row in rows:
        names.setdefault(row.failure, set()).add(f"{row.words.zh}（{row.unit}）" if row.unit else row.words.zh)
    for failure, known in names.items():
        assert entries[failure] in known
    locale = json.loads((ROOT / "tapelayer/workbench/client/src/locales/zh.json").read_text("utf-8"))
    told = tomllib.loads((ROOT / "tapelayer/languages/zh/failures.toml").read_text("utf-8"))
    for key in told:
        if not PLACE.search(key):
            assert failure_name(key, (), Say("zh"))[0] == told[key].partition("（")[0]
    simple = {worded(key)[0].replace(" ", "_"): text for key, text in told.items() if not PLACE.search(key)}
    for stem, text in simple.items():
        if name := locale.get(f"failure.{stem}"):
            assert text.partition("（")[0] == name
