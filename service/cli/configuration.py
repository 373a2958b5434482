"""The commands about the program itself: its configuration, and compiling it."""

from wayfi.service.cli.options import Files, Json, Quiet, Settings, command_output, configuration


def show_config(config: Files = None, settings: Settings = None, quiet: Quiet = False, as_json: Json = False) -> None:
    """Print the configuration in force, with units and the reason for each default."""
    with command_output(quiet, as_json) as output:
        from wayfi.service.config import config_dict, config_toml

        configured = configuration(config, settings)
        output.say(config_toml(configured, explain=True).rstrip("\n"))
        output.result(config_dict(configured))


def compile_all(quiet: Quiet = False, as_json: Json = False) -> None:
    """Compile what runs compiled, once after installation; else the first replay or run does it."""
    with command_output(quiet, as_json) as output:
        from wayfi.service.cli.warm_up import run_warm_up

        run_warm_up(output)
