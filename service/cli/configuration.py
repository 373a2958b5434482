"""The commands about the program itself: its configuration, and compiling it."""

from wayfi.service.cli.options import Files, Settings, command, configuration
from wayfi.service.process.console import Output


@command
def show_config(output: Output, config: Files = None, settings: Settings = None) -> None:
    """Print the configuration in force, with units and the reason for each default."""
    from wayfi.service.config import config_dict, config_toml

    configured = configuration(config, settings)
    output.say(config_toml(configured, explain=True).rstrip("\n"))
    output.result(config_dict(configured))


@command
def compile_all(output: Output) -> None:
    """Compile what runs compiled, once after installation; else the first replay or run does it."""
    from wayfi.service.cli.warm_up import run_warm_up

    run_warm_up(output)
