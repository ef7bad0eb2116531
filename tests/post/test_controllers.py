from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

import post.controllers
from post.controllers import Controller, load, names
from post.controllers.parsing import GIVEN, parse
from post.controllers.table import ArcRule, AxisWord, Blocks, Codes, Feed, Timing
from tapelayer.errors import ControllerRefused
from tapelayer.motion.trajectory import Event
from tests.helpers.machines import TEN_AXES, tape_layer

FOLDER = Path(post.controllers.__file__).parent
JB3208 = (FOLDER / "jb3208.toml").read_text(encoding="utf-8")


def refused(text: str) -> str:
    with pytest.raises(ControllerRefused) as caught:
        parse(text.encode(), "folder/mine.toml")
    return str(caught.value)


def changed(*changes: tuple[str, str]) -> str:
    text = JB3208
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize("name", names())
def test_every_built_in_table_loads_and_is_named_after_its_file(name: str) -> None:
    controller = load(name)
    assert controller.name == name
    assert (FOLDER / f"{name}.toml").is_file()
    with pytest.raises(ValidationError, match="frozen"):
        controller.title = "other"  # type: ignore[misc]


def test_jb3208_has_the_words_of_table_2() -> None:
    controller = load("jb3208")
    events = controller.event_words()
    assert [controller.codes.rapid, controller.codes.linear, controller.codes.clockwise] == ["G00", "G01", "G02"]
    assert [controller.codes.counterclockwise, controller.codes.dwell] == ["G03", "G04"]
    assert [controller.codes.absolute, controller.codes.incremental] == ["G90", "G91"]
    table_2 = (Event.SHOE_DOWN, Event.ROLLER_DOWN, Event.KNIFE_1_DOWN, Event.KNIFE_1_UP, Event.SUPPLY_MODE)
    assert [events[event] for event in table_2] == ["M20", "M21", "M22", "M23", "M24"]
    assert "".join(axis.address for axis in controller.axes) == "XYZACUVQDE"


def test_addresses_come_in_word_order_whatever_the_order_of_the_joints() -> None:
    found = load("jb3208").addressed(TEN_AXES)
    assert [(axis.address, TEN_AXES[index]) for axis, index in found] == [
        (letter.upper(), letter) for letter in "xyzacuvqde"
    ]


def test_a_joint_without_address_is_refused_by_name() -> None:
    with pytest.raises(ControllerRefused, match="controller jb3208: has no address for axis theta; use a controller"):
        load("jb3208").addressed(("x", "y", "z", "theta"))


def test_two_joints_of_a_machine_behind_one_address_are_refused() -> None:
    controller = parse(changed(('joints = ["c"]', 'joints = ["c", "theta"]')).encode(), "mine.toml")
    assert [axis.address for axis, _ in controller.addressed(("x", "theta"))] == ["X", "C"]
    with pytest.raises(ControllerRefused, match="controller mine: axes c and theta share address C"):
        controller.addressed(("c", "theta"))


def test_a_table_of_ones_own_is_named_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "shop floor.toml"
    path.write_text(changed(('"M20"', '"M120"')), encoding="utf-8")
    controller = load(str(path))
    assert controller.name == "shop floor"
    assert controller.event_words()[Event.SHOE_DOWN] == "M120"


def test_unknown_names_and_paths_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ControllerRefused, match="^jb3028: is not a built-in controller; did you mean jb3208?"):
        load("jb3028")
    with pytest.raises(ControllerRefused, match="^zzz: is not a built-in controller; there are .*jb3208"):
        load("zzz")
    with pytest.raises(ControllerRefused, match="no.toml: cannot be read: no such file or directory$"):
        load(str(tmp_path / "no.toml"))
    with pytest.raises(ControllerRefused, match="cannot be read: is a directory$"):
        load(f"{tmp_path}/")


def test_what_is_not_toml_is_refused_with_its_place() -> None:
    assert refused("title = \n") == "folder/mine.toml:1:9: not TOML: invalid value"
    with pytest.raises(ControllerRefused, match=r"^mine.toml: byte 9 is not UTF-8; save the file as UTF-8$"):
        parse(b'title = "\xff"', "mine.toml")


def test_all_faults_of_keys_and_values_come_at_once_with_line_and_nearest_name() -> None:
    text = changed(
        ("shoe_down", "shoe_dwn"), ("max_line", "maxline"), ("number_step = 10", "number_step = -1"), ("zx =", "zy =")
    )
    lines = text.splitlines()
    at = {key: next(i for i, line in enumerate(lines, 1) if key in line) for key in ("shoe_dwn", "maxline", "zy =")}
    step = next(i for i, line in enumerate(lines, 1) if line.startswith("number_step"))
    assert refused(text).splitlines() == [
        f"folder/mine.toml:{step - 1}: blocks.max_line is missing",
        f"folder/mine.toml:{step}: blocks.number_step: input should be greater than or equal to 0, got -1",
        f"folder/mine.toml:{at['maxline']}: unknown key maxline; did you mean max_line?",
        f"folder/mine.toml:{at['zy =']}: unknown key zy; did you mean zx?",
        f"folder/mine.toml:{at['shoe_dwn']}: unknown key shoe_dwn; did you mean shoe_down?",
    ]


def test_all_collisions_come_at_once() -> None:
    text = changed(
        ('address = "E"', 'address = "F"'),
        ('address = "D"', 'address = "R"'),
        ('address = "Q"', 'address = "P"'),
        ('address = "V"', 'address = "J"'),
        ('joints = ["u"]', 'joints = ["x"]'),
        ('address = "Y"', 'address = "X"'),
        ('"G94"', '"G1.0"'),
        ('"M21"', '"M020"'),
        ('"M33"', '"M30"'),
        ('restated = ["G90"]', 'restated = ["G90 G65 T1"]'),
        ('["X", "Y", "Z"]]', '["X", "Z", "W"]]'),
    )
    message = refused(text)
    for sentence in (
        "axes: address F is the feed; give e another",
        "axes: address R is reserved by the control; give d another",
        "axes: address P is the time of a dwell; give q another",
        "axes: address J is the centre of arcs; give v another",
        "axes: joint x has two addresses; give it one",
        "axes: address X has an axis already; give y another",
        "feed.path: W is not the address of an axis",
        "codes: G1.0 stands for both linear and per_minute; each needs a word of its own",
        "events: M020 stands for both shoe_down and roller_down; each needs a word of its own",
        "events: M30 stands for both end and knife_2_down; each needs a word of its own".replace("_down", "_up"),
        "blocks.restated: G65 is not in codes or codes.no_effect, so no reader would know it",
        "blocks.restated: T1 is not in codes or codes.no_effect, so no reader would know it",
    ):
        assert f": {sentence}\n" in message + "\n"
    assert len(message.splitlines()) == 12
    assert "folder/mine.toml:0" not in message and "folder/mine.toml:" in message


def test_words_that_take_axes_and_words_at_rest_are_linted() -> None:
    text = changed(
        ('joints = ["q"], unit = "mm"', 'joints = ["q"], unit = "mm", word = "M29"'),
        ('joints = ["d"], unit = "deg"', 'joints = ["d"], unit = "deg", word = "M22"'),
        ('joints = ["e"], unit = "deg"', 'joints = ["e"], unit = "deg", alone = true'),
    )
    text += '[events_at_rest]\nshoe_down = "M23"\nair_on = "M99"\n'
    message = refused(text)
    for sentence in (
        "axes: M22 and M29 take axes; all such axes need one word and one value of alone",
        "axes: M22 is the word of an event; give the axis another",
        "axes: address E stands alone without a word; give the word that takes it",
        "events_at_rest: M23 of shoe_down is the word of another event too; give it one of its own",
        "events_at_rest: air_on is not in events; add it there",
    ):
        assert f": {sentence}\n" in message + "\n"
    assert len(message.splitlines()) == 5


def test_an_m_word_that_takes_an_address_frees_its_letter() -> None:
    taken = ('address = "E", joints = ["e"], unit = "deg"', 'address = "R", joints = ["e"], unit = "deg", word = "M29"')
    assert parse(changed(taken).encode(), "mine.toml").axes[-1].word == "M29"


@pytest.mark.parametrize("entry", ["G8", "G187 P0.01", "S", "FGROUP(X,Y)"])
def test_words_without_effect(entry: str) -> None:
    text = changed(("planes = { xy", f'no_effect = ["{entry}"]\nplanes = {{ xy'), ('comment = "("', 'comment = ";"'))
    assert parse(text.encode(), "mine.toml").codes.no_effect == (entry,)


@pytest.mark.parametrize("entry", ["M8", "G187 P", "GOTO 5"])
def test_what_looks_like_a_word_cannot_be_without_effect(entry: str) -> None:
    text = changed(("planes = { xy", f'no_effect = ["{entry}"]\nplanes = {{ xy'))
    assert "codes.no_effect[0]: expected a letter, a G word such as G40" in refused(text)


def test_what_needs_a_g_word_is_refused_without_it() -> None:
    text = changed(('"G92"', '""'), ('u_reset = "never"', 'u_reset = "course"'), (', yz = "G19"', ""))
    text += '[levels]\narc_on = "S"\n'
    message = refused(text)
    assert "u_reset: needs codes.set_position, the G word that sets the tape's axis to zero; give it" in message
    assert "levels: arc_on is not in events; add it there" in message
    assert "levels: S of arc_on is not in codes.no_effect, so no reader would know it" in message
    assert "arcs.planes: yz without a G word in codes.planes; give it" in message


NO_EFFECT = ("planes = { xy", "no_effect = [{}]\nplanes = {{ xy")


def ignoring(*texts: str) -> tuple[str, str]:
    """Return the change that adds texts without effect."""
    return NO_EFFECT[0], NO_EFFECT[1].format(", ".join(f'"{text}"' for text in texts))


@pytest.mark.parametrize(
    ("changes", "key", "sentence"),
    [
        (
            [('["G90"]', '["G9\u0660"]')],
            "restated =",
            "blocks.restated[0]: expected printable ASCII signs, and not bla",
        ),
        (
            [('["G90"]', '["G90", " "]')],
            "restated =",
            "blocks.restated[1]: expected printable ASCII signs, and not bla",
        ),
        ([('"G94"', '"G9\u0664"')], "per_minute =", "codes.per_minute: expected a G word such as G1 or G92.1, got"),
        ([('"M21"', '"M2\u0661"')], "roller_down =", "events.roller_down: expected an M word such as M20 or M62 P3, "),
        (
            [('first_line = "%"', 'first_line = "%\\nG0 X5"')],
            "first_line =",
            "blocks.first_line: expected printable AS",
        ),
        (
            [('first_line = "%"', 'first_line = "\u7a0b"')],
            "first_line =",
            "blocks.first_line: expected printable ASCII si",
        ),
        ([('title = "the', 'title = "\\u001b[2Jthe')], "title =", "title: expected one line of printable signs"),
        (
            [('["G90"]', '["G90 G02"]')],
            "restated =",
            "blocks.restated: G02 is the word of clockwise; a text states mode",
        ),
        (
            [("preamble = []", 'preamble = ["G4"]')],
            "preamble =",
            "blocks.preamble: G4 is the word of dwell; a text sta",
        ),
        ([("preamble = []", 'preamble = ["G92"]')], "preamble =", "blocks.preamble: G92 is the word of set_position; "),
        ([('["G90"]', '["G91 G90"]')], "restated =", "blocks.restated: G90 and G91 stand in one block; give each its"),
        ([('["G90"]', '["G91"]')], "restated =", "blocks.restated: leaves the control in G91, increments; add G90"),
        ([('["G90"]', '["G90 G93"]')], "restated =", "blocks.restated: leaves the control in G93; add G94, as feed.mo"),
        (
            [('mode = "per_minute"', 'mode = "inverse_time"'), ("modal = true", "modal = false")],
            "restated =",
            "blocks.restated: leaves the control in G94; add G93, as feed.mode is inverse_time",
        ),
        (
            [('mode = "per_minute"', 'mode = "inverse_time"'), ('["G90"]', '["G90 G93"]')],
            "modal =",
            "feed.modal: is true, but an inverse time holds for its own block; make it false",
        ),
        ([ignoring("G1")], "no_effect =", "codes.no_effect: G1 is the word of linear, so it has an effect; remove it"),
        ([ignoring("G4 P1")], "no_effect =", "codes.no_effect: G4 P1 is the word of dwell, so it has an effect; remo"),
        ([ignoring("G61")], "no_effect =", "codes.no_effect: G61 is the word of exact stop, so it has an effect; re"),
        ([ignoring("G64 P0.01")], "no_effect =", "codes.no_effect: G64 P0.01 is the word of blending, so it has an"),
        (
            [ignoring("X")],
            "no_effect =",
            "codes.no_effect: X is the address of an axis, so it has an effect; remove it",
        ),
        ([ignoring("F")], "no_effect =", "codes.no_effect: F is the feed, so it has an effect; remove it"),
        ([ignoring("G187 X5")], "no_effect =", "codes.no_effect: X of G187 X5 is the address of an axis; a word's arg"),
        ([ignoring("G1 X5 %")], "no_effect =", "codes.no_effect: G1 in G1 X5 % is the word of linear; readers ign"),
        ([ignoring("X5 %")], "no_effect =", "codes.no_effect: X5 in X5 % moves an axis; a text moves nothing"),
        ([ignoring("GROUP(X,Y)")], "no_effect =", "codes.no_effect: GROUP(X,Y) holds (, which begins a comment; leav"),
        (
            [('last_line = "%"', 'last_line = "G00 Z0"')],
            "last_line =",
            "blocks.last_line: G00 in G00 Z0 is the word of",
        ),
        (
            [('last_line = "%"', 'last_line = "M20"')],
            "last_line =",
            "blocks.last_line: M20 in M20 switches; readers ig",
        ),
        (
            [('first_line = "%"', 'first_line = "O1 (a)"')],
            "first_line =",
            "blocks.first_line: O1 (a) holds (, which beg",
        ),
        (
            [('first_line = "%"', f'first_line = "{"%" * 201}"')],
            "first_line =",
            "blocks.first_line: has 201 characters,",
        ),
        (
            [("planes = [", 'offsets = ["I", "I", "K"]\nplanes = [')],
            "offsets =",
            "arcs.offsets: I is the centre along an",
        ),
        (
            [("planes = [", 'offsets = ["F", "J", "K"]\nplanes = [')],
            "offsets =",
            "arcs.offsets: F is the feed; give an",
        ),
        (
            [('dwell_address = "P"', 'dwell_address = "N"')],
            "dwell_address =",
            "codes.dwell_address: N numbers a block; ",
        ),
        ([('address = "E"', 'address = "M1="')], "axes =", "axes: address M1= begins a switching word; give e another"),
        (
            [('"M21"', '"M21 X5"')],
            "roller_down =",
            "events.roller_down: X of M21 X5 is the address of an axis; a word's",
        ),
        (
            [('"M21"', '"M21 F5"')],
            "roller_down =",
            "events.roller_down: F of M21 F5 is the feed; a word's argument nee",
        ),
        ([('"M21"', '"M20 P1"')], "roller_down =", "events.roller_down: M20 P1 and M20 differ by an argument alone"),
        (
            [('"M20"', '"M20 P1"'), ('"M21"', '"M20 P01"')],
            "shoe_down =",
            "events: M20 P01 stands for both shoe_down and r",
        ),
        (
            [('unit = "deg" },\n]', 'unit = "deg", word = "M30" },\n]')],
            "axes =",
            "axes: M30 ends the program; give the",
        ),
    ],
)
def test_what_no_program_could_carry_out_is_the_tables_fault(
    changes: list[tuple[str, str]], key: str, sentence: str
) -> None:
    text = changed(*changes)
    line = next(number for number, row in enumerate(text.splitlines(), 1) if row.startswith(key))
    if sentence.startswith("events:"):
        line -= 1
    message = refused(text)
    assert message.startswith(f"folder/mine.toml:{line}: {sentence}"), message
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize(
    "changes",
    [
        [('first_line = "%"', 'first_line = "%_N_G0_MPF"')],
        [('first_line = "%"', 'first_line = "(G0 X5)"')],
        [('first_line = "%"', 'first_line = "O1234"')],
        [("preamble = []", 'preamble = ["G91", "G17 G90"]')],
        [("preamble = []", 'preamble = ["G93", "G94"]')],
        [('comment = "("', 'comment = ";"'), ignoring("CYCLE832(0.05,3,1)", "FGROUP(X,Y,Q1)", "G187 P0.01", "S")],
        [('title = "the', 'title = "\u94fa\u5e26\u673a')],
    ],
)
def test_texts_that_do_what_their_places_allow(changes: list[tuple[str, str]]) -> None:
    assert parse(changed(*changes).encode(), "mine.toml").name == "mine"


def test_units_that_do_not_fit_the_machines_joints_are_refused() -> None:
    turning = {axis.name: axis.revolute for axis in tape_layer().axes}
    load("jb3208").check_units(turning)
    swapped = changed(
        ('joints = ["c"], unit = "deg"', 'joints = ["c"], unit = "mm"'),
        ('joints = ["x"], unit = "mm"', 'joints = ["x"], unit = "deg"'),
    )
    with pytest.raises(ControllerRefused) as caught:
        parse(swapped.encode(), "mine.toml").check_units(turning)
    assert str(caught.value).splitlines() == [
        'controller mine: axes: X counts joint x in deg, but it slides; give unit = "mm"',
        'controller mine: axes: C counts joint c in mm, but it turns; give unit = "deg"',
    ]


def test_a_number_step_beyond_the_largest_number_is_refused() -> None:
    assert "number_step is beyond number_maximum" in refused(
        changed(("number_maximum = 9999990", "number_maximum = 5"))
    )


def test_a_table_cannot_name_itself() -> None:
    assert refused('name = "x"\n' + JB3208) == "folder/mine.toml:1: unknown key name; the file's name is the name"
    sentence = "folder/mine.toml:1: unknown key sha256; the file's bytes have one of their own"
    assert refused(f'sha256 = "{"0" * 64}"\n{JB3208}') == sentence


def test_controller_is_hashable_by_value_of_its_table() -> None:
    assert load("jb3208") == load("jb3208")
    assert isinstance(load("jb3208"), Controller)


def test_the_docs_name_every_key_table_and_event() -> None:
    text = (FOLDER.parents[1] / "docs" / "controllers.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`\[?([a-z_0-9]+)\]?`", text))
    keys = {
        key
        for model in (AxisWord, Blocks, Codes, Feed, ArcRule, Timing, Controller)
        for key in model.model_fields
        if model is not Controller or key not in GIVEN
    } - {"blocks", "codes", "feed", "arcs", "time", "events"}
    assert keys - named == set()
    assert {"blocks", "codes", "feed", "arcs", "time", "events"} <= named
    assert {event.name.lower() for event in Event if event} - named == set()
    assert set(names()) - named == set()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("tolerance_mm = 0.02", "tolerance_mm = -0.02"), "tolerance_mm"),
        (("tolerance_mm = 0.02", "tolerance_mm = nan"), "tolerance_mm"),
        (("tolerance_mm = 0.02", ""), "corner look_ahead without tolerance_mm above 0; give how far"),
        (('exact = "G61"\n', ""), "corner look_ahead without exact; give the words"),
        (('corner = "look_ahead"', 'corner = "lookahead"'), "corner"),
        (
            ('corner = "look_ahead"', 'corner = "stop"'),
            "corner stop has no use for exact and blended; leave",
        ),
    ],
)
def test_a_time_law_that_cannot_be_is_refused_in_a_sentence(change: tuple[str, str], sentence: str) -> None:
    assert sentence in refused(changed(change))
