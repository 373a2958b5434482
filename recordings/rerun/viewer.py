"""`wayfi view`: the log of a drive in the Rerun viewer or a browser."""

from pathlib import Path
from urllib.parse import quote

from wayfi.recordings.rerun.viewer_process import HOST, ViewerError, free_port, viewer_process

RADIO_LOG = "radio.rrd"  # of `wayfi radio`


def view(path: Path, web: bool = False) -> None:
    """Show a log: `path` is an .rrd file, or a folder with session.rrd, session_*.rrd (the newest), or radio.rrd.

    Blocks until the viewer ends; Ctrl-C ends it. With `web`, serves the web viewer on 127.0.0.1 and prints its address.
    Raises ViewerError if there is no log or the viewer fails.
    """
    log = find_log(path)
    arguments, address = _served(log) if web else (["--port", str(free_port()), str(log)], None)
    with viewer_process(arguments) as process:
        if address is not None:
            print(f"open {address} (Ctrl-C ends it)", flush=True)  # noqa: T201 - the address is the command's result
        try:
            code = process.wait()
        except KeyboardInterrupt:
            return
    if code:
        hint = "is a port or the browser blocked?" if web else "try --web where there is no display"
        raise ViewerError(f"the Rerun viewer ended with code {code} on {log}: {hint}")


def find_log(path: Path) -> Path:
    """The .rrd file of `path`, a file or a folder. Raises ViewerError if there is none."""
    if path.is_file():
        if path.suffix != ".rrd":
            raise ViewerError(f"{path} is not an .rrd file: name the folder of a run or its session.rrd")
        return path
    if not path.is_dir():
        raise ViewerError(f"{path} does not exist: name the folder of a run or its session.rrd")
    session = path / "session.rrd"
    if session.is_file():
        return session
    parts = sorted(path.glob("session_*.rrd"), key=lambda part: (part.stat().st_mtime_ns, part.name))
    radio = path / RADIO_LOG
    if not parts and radio.is_file():
        return radio
    if not parts:
        raise ViewerError(f"{path} holds no session.rrd and no session_*.rrd: replay without --no-rrd")
    return parts[-1]


def _served(log: Path) -> tuple[list[str], str]:
    """The viewer's arguments that serve `log`, and the address to open."""
    page, data = free_port(), free_port()
    source = quote(f"rerun+http://{HOST}:{data}/proxy", safe=":/")
    arguments = ["--serve-web", "--web-viewer-port", str(page), "--port", str(data), str(log)]
    return arguments, f"http://{HOST}:{page}/?url={source}&hide_welcome_screen=1"
