"""Not judged: what no verdict on a program covers, so that every report and program can name it."""

from __future__ import annotations

from tapelayer.reporting.words import ENGLISH, Say, Words

COLLISION = Words("collision", "碰撞")
ACCELERATION = Words("acceleration", "加速度")
CONTROL_TIME = Words("the control's own time", "数控系统的实际用时")


def unjudged(timed: bool) -> tuple[Words, ...]:
    """Return what no verdict covers.

    Args:
        timed: whether the time on the control is predicted, with the axes' accelerations.

    >>> english(unjudged(timed=True)), english(unjudged(timed=False))
    (('collision',), ('collision', 'acceleration', "the control's own time"))
    """
    return (COLLISION,) if timed else (COLLISION, ACCELERATION, CONTROL_TIME)


def english(names: tuple[Words, ...]) -> tuple[str, ...]:
    """Return the English names of what is not judged.

    >>> english((COLLISION, ACCELERATION))
    ('collision', 'acceleration')
    """
    return tuple(words.en for words in names)


def sentence(names: tuple[Words, ...], say: Say = ENGLISH) -> str:
    """Return what is not judged as one line; empty if everything is.

    >>> sentence((COLLISION, ACCELERATION)), sentence((COLLISION, ACCELERATION), Say("zh")), sentence(())
    ('not judged: collision, acceleration', '未判定：碰撞、加速度', '')
    """
    if not names:
        return ""
    listed = say(", ", "、").join(say.words(name) for name in names)
    return say("not judged: {listed}", "未判定：{listed}", listed=listed)
