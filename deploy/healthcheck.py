"""`python healthcheck.py F.toml`: exit 0 where the daemon of that configuration is ready, else 1 with one line."""

import sys
from dataclasses import replace
from pathlib import Path

from wayfi.backend.errors import WayfiError
from wayfi.service.config import ZenohConfig, load_config
from wayfi.service.transport.publishers import ALIVE
from wayfi.service.transport.zenoh_session import key_of, open_guest_session

PATIENCE_S = 2.0


def is_ready(config: ZenohConfig) -> bool:
    """Whether the daemon that listens on this machine says that it is ready. Raises ZenohError where nobody listens."""
    with open_guest_session(replace(config, connect=[])) as session:
        replies = session.liveliness().get(key_of(config, ALIVE), timeout=PATIENCE_S)
        return any(reply.ok is not None for reply in replies)


def main() -> int:
    """What the container's HEALTHCHECK runs."""
    try:
        if is_ready(load_config([Path(sys.argv[1])]).zenoh):
            return 0
        sys.stderr.write("not ready\n")
    except WayfiError as error:
        sys.stderr.write(f"{error}\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
