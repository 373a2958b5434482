"""The robot that the options of `wayfi simulate` name."""

import typer

from wayfi.recordings.simulation.robots.models import Robot


def robot_model(name: str | None, rough: bool | None) -> Robot:
    """The error model that --robot names, or --rough (typical) or --ideal; typical without any. Raises BadParameter."""
    if name is not None and rough is not None:
        raise typer.BadParameter("--robot already says what --rough or --ideal would")
    if name is None:
        return Robot.IDEAL if rough is False else Robot.TYPICAL
    if name not in list(Robot):
        raise typer.BadParameter(f"there is no robot {name!r}; there are {', '.join(Robot)}")
    return Robot(name)
