"""`python -m wayfi.service.cli` is `wayfi`."""

from wayfi.service.cli.app import main

main()
