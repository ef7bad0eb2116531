"""The machines' URDF files, found when installed."""

from importlib.resources import files
from pathlib import Path

TAPELAYER = Path(str(files(__name__).joinpath("tapelayer.urdf")))
SPRAYER = Path(str(files(__name__).joinpath("sprayer.urdf")))
