"""Not judged: what no verdict on a program covers, so that every report and program can name it."""

from __future__ import annotations

from tapelayer.reporting.words import Words

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


def sentence(names: tuple[str, ...] | list[str]) -> str:
    """Return what is not judged as one line; empty if everything is.

    >>> sentence(["collision", "acceleration"]), sentence([])
    ('not judged: collision, acceleration', '')
    """
    return f"not judged: {', '.join(names)}" if names else ""
