"""Failure names: what a program fails of as text for people, in both languages."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tapelayer.reporting.quantity import Measured, Row, quantities
from tapelayer.reporting.words import Say

DEVICES = {
    "shoe": "压靴",
    "auxiliary_roller": "辅压辊",
    "roller": "辅压辊",
    "knife_1": "切刀 1",
    "knife_2": "切刀 2",
    "heater": "加热器",
    "air": "压缩空气",
    "arc": "电弧",
}
# Failures of a device, by the ending of the key.
OF_DEVICES = {
    "switched_again": "{device}重复切换",
    "left_on": "结束时{device}仍开启",
    "off_every_cut": "{device}落下处无切割",
    "on_astray": "{device}开启时刻偏离",
    "off_astray": "{device}关闭时刻偏离",
    "on_words": "{device}开启指令数",
    "off_words": "{device}关闭指令数",
    "down_words": "{device}落下指令数",
    "up_words": "{device}抬起指令数",
    "down": "{device}落下位置",
    "up": "{device}抬起位置",
}
OF_AXES = {"_speed": "超速", "_acceleration": "加速度超限", None: "超出行程"}
MOVING = {"rapid": "快移时{device}开启", "stop": "停止时{device}开启", "pause": "暂停时{device}开启"}
# Failures that no quantity of a report measures, without their unit.
OTHERS = {
    "air_lead": "电弧前供气时间",
    "approach_speed": "接近速度",
    "arc_on_without_air": "无压缩空气时电弧开启",
    "block_time": "程序段用时",
    "circle_centre": "圆弧圆心",
    "courses_laid": "已铺道次数",
    "cut_width": "切割宽度",
    "cuts_made": "切割数",
    "first_motion_axes": "首次运动声明的轴",
    "gun_speed": "喷枪速度",
    "head_moves_in_rapids": "快移中的铺带头运动",
    "heater_time": "加热器下停留时间",
    "laid_with_shoe_up": "压靴抬起时铺放",
    "lay_speed": "铺放速度",
    "not_sprayed": "未喷涂",
    "plunge": "下压行程",
    "retract": "抬离行程",
    "roll_used": "单卷用带",
    "run_back": "沿道次回退",
    "run_out": "收尾行程",
    "slow_gun_speed": "喷枪速度过低",
    "sprayed_length": "喷涂长度",
    "supply_mode_before_feed": "设定供带模式前已送带",
    "tape": "用带账",
    "tape_run_back": "料带回退",
    "tape_taken_back_too_far": "料带回收过多",
    "theta_step": "单段 theta 步距",
    "thread_speed": "送带速度",
    "time_shares": "时间占比",
    "unstated_axes": "未声明即使用的轴",
    "waste_before": "道次前废料",
}
UNITS = {
    "_mm_per_s2": "mm/s2",
    "_deg_per_s2": "deg/s2",
    "_mm_per_s": "mm/s",
    "_deg_per_s": "deg/s",
    "_mm": "mm",
    "_percent": "%",
    "_deg": "deg",
    "_ms": "ms",
    "_m": "m",
    "_s": "s",
}


def worded(what: str) -> tuple[str, str]:
    """Return the English words and the unit of a key.

    >>> worded("axis_c_speed_deg_per_s")
    ('axis c speed', 'deg/s')
    """
    stem, unit = _split(what)
    return stem.replace("_", " "), unit


def failure_name(what: str, rows: Sequence[Row[Measured]], say: Say) -> tuple[str, str]:
    """Return the name and the unit of a failure.

    Args:
        what: key of the failure.
        rows: of the kind of machine, which know their own names.
        say: the language.

    Examples:
        >>> failure_name("axis_c_deg", (), Say("zh")), failure_name("knife_1_left_on", (), Say("en"))
        (('c 轴超出行程', 'deg'), ('knife 1 left on', ''))
        >>> failure_name("axis_x_acceleration_mm_per_s2", (), Say("zh"))
        ('x 轴加速度超限', 'mm/s2')
    """
    stem, unit = _split(what)
    return say(stem.replace("_", " "), _chinese(stem, what, rows)), unit


def _split(what: str) -> tuple[str, str]:
    ending = next((ending for ending in UNITS if what.endswith(ending)), "")
    return what.removesuffix(ending), UNITS.get(ending, "")


def _chinese(stem: str, what: str, rows: Sequence[Row[Measured]]) -> str:
    measured = next((row.words.zh for row in quantities(rows) if row.failure == what), None)
    if measured or stem in OTHERS:
        return measured or OTHERS[stem]
    if axis := re.fullmatch(r"axis_(.+?)(_speed|_acceleration)?", stem):
        return f"{axis[1]} 轴{OF_AXES[axis[2]]}"
    if moving := re.fullmatch(r"(rapid|stop|pause)_with_(.+)_on", stem):
        return MOVING[moving[1]].format(device=DEVICES.get(moving[2], moving[2]))
    for ending, text in OF_DEVICES.items():
        device = stem.removesuffix(f"_{ending}")
        if device != stem and device in DEVICES:
            return text.format(device=DEVICES[device])
    return stem.replace("_", " ")
