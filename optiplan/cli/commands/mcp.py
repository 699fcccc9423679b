"""`optiplan mcp`: the planner as tools for agents."""

from typing import Annotated

import typer


def mcp(
    list_tools: Annotated[bool, typer.Option("--list", help="print the tools and end")] = False,
) -> int:
    """Serve the planner to agents, by the Model Context Protocol on standard input and output.

    Tools: list_robots, check_problem, plan, explain_failure, render_picture. Resource: the JSON schema of a problem.
    Needs the extra `agents`.

    [bold]Examples[/]

      optiplan mcp --list

    In the settings of a client that starts servers by a command:

      {"mcpServers": {"optiplan": {"command": "optiplan", "args": ["mcp"]}}}
    """
    import anyio

    from optiplan.cli.agent_tools import agent_server
    from optiplan.cli.output import results

    server = agent_server()
    if list_tools:
        for tool in anyio.run(server.list_tools):
            results().print(f"[bold]{tool.name}[/]  {tool.description}", soft_wrap=True)
        return 0
    server.run("stdio")
    return 0
