"""Kinds: the kinds of job that there are."""

from __future__ import annotations

from typing import Literal

from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import JobSetup
from tapelayer.spraying.settings import SpraySetup

JobKind = Literal["lay", "spray"]
MODELS: dict[JobKind, type[JobSetup]] = {"lay": Setup, "spray": SpraySetup}
