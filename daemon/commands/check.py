"""`regolithd check`: test configuration, bus, nodes, broker, models, disks and clock, and print each problem."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from regolithd.daemon.check.finding import Finding
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.config.reader import Problem

_STYLES = {"good": "green", "warning": "yellow", "wrong": "bold red", "not checked": "dim"}
_MARKS = {"good": "✓", "warning": "!", "wrong": "✗", "not checked": "–"}


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("check")(check)


def check(
    *,
    config: Annotated[Path, typer.Option(help="The rover's configuration (rover.toml).")] = Path(
        "/etc/regolithd/rover.toml"
    ),
    syntax: Annotated[bool, typer.Option("--syntax", help="Check only the file, neither bus nor broker.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Check configuration, bus, nodes, broker, models, disks and clock; print each problem and its remedy.

    Changes and moves nothing, and does not disturb a running daemon. Exit status: 0 if nothing is wrong, 78 if the
    configuration is invalid or, with `--syntax`, names a file of `[mqtt]` that is not there; 1 for any other problem.
    """
    from regolithd.daemon.config.reader import EXIT_STATUS, ConfigurationError, missing_files, read_configuration

    try:
        configuration = read_configuration(config)
    except ConfigurationError as error:
        _print_problems(error.problems, as_json=json)
        raise typer.Exit(EXIT_STATUS) from error
    if syntax:
        if missing := missing_files(configuration, config):
            _print_problems(missing, as_json=json)
            raise typer.Exit(EXIT_STATUS)
        typer.echo(f"{config}: good")
        return
    findings = _findings(configuration, quiet=json)
    _print_findings(findings, config, as_json=json)
    raise typer.Exit(int(any(finding.verdict == "wrong" for finding in findings)))


def _findings(configuration: Configuration, *, quiet: bool) -> list[Finding]:
    import asyncio

    from regolithd.daemon.check.all_checks import check_everything
    from regolithd.daemon.terminal import terminal

    with terminal(stderr=True, quiet=quiet).status("Checking bus, nodes, models, broker, disks and clock …"):
        return asyncio.run(check_everything(configuration))


def _print_problems(problems: list[Problem], *, as_json: bool) -> None:
    from json import dumps

    if as_json:
        typer.echo(dumps([{"subject": "configuration", "verdict": "wrong", "text": str(p)} for p in problems]))
        return
    for problem in problems:
        typer.echo(str(problem), err=True)
    count = len(problems)
    typer.echo(f"{count} problem{'s' if count != 1 else ''} in the configuration; nothing else was checked.", err=True)


def _print_findings(findings: list[Finding], config: Path, *, as_json: bool) -> None:
    from dataclasses import asdict
    from json import dumps

    from rich.text import Text

    from regolithd.daemon.terminal import terminal

    if as_json:
        typer.echo(dumps([asdict(finding) for finding in findings], indent=2))
        return
    console = terminal()
    console.print(_table(findings, config))
    wrong = sum(finding.verdict == "wrong" for finding in findings)
    warnings = sum(finding.verdict == "warning" for finding in findings)
    if wrong:
        console.print(Text.assemble((f"{wrong} wrong", "bold red"), f", {warnings} warnings."))
    elif warnings:
        console.print(f"Nothing wrong, {warnings} warnings.", style="yellow")
    else:
        console.print("Nothing wrong.", style="green")


def _table(findings: list[Finding], config: Path) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table("", "subject", "finding and remedy", box=box.SIMPLE_HEAD, expand=True)
    table.add_row(Text(_MARKS["good"], style="green"), "configuration", str(config))
    for finding in findings:
        style = _STYLES[finding.verdict]
        text = Text(finding.text, style="" if finding.verdict == "good" else style)
        if finding.remedy:
            text.append(f"\n→ {finding.remedy}", style="default not bold")
        table.add_row(Text(_MARKS[finding.verdict], style=style), finding.subject, text)
    return table
