"""NC text: verified trajectories to programs, and programs back to trajectories."""

from __future__ import annotations

from post.controllers import Controller, load
from post.program import write
from post.reader import Program, read
from post.source import Comment

__all__ = ["Comment", "Controller", "Program", "load", "read", "write"]
