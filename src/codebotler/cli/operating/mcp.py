"""`codebotler mcp`: let agents use the robot over the Model Context Protocol."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from codebotler.cli import options
from codebotler.cli.model_options import inherit_options, model_settings
from codebotler.core.errors import UserError

HttpOption = Annotated[
    bool, typer.Option("--http", help="Serve agents over HTTP on the page's port, not over standard input.")
]
AskClientOption = Annotated[
    bool | None,
    typer.Option(
        "--ask-client/--page-only",
        help="Whether the agent's client may ask its person for approval; by default not with --http.",
    ),
]
AgentTokenOption = Annotated[
    str | None,
    typer.Option(
        envvar="CODEBOTLER_AGENT_TOKEN", help="The access token for agents with --http; a new one by default."
    ),
]


@inherit_options(options.robot_settings)
@inherit_options(model_settings)
def serve_agents(
    http: HttpOption = False,
    ask_client: AskClientOption = None,
    port: options.PortOption = None,
    token: options.TokenOption = None,
    agent_token: AgentTokenOption = None,
    model: options.ModelsOption = None,
    base_url: options.BaseUrlOption = None,
    candidates: options.CandidatesOption = 1,
    **shared: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Let agents use the robot, with a person's approval.

    Clients of the Model Context Protocol (MCP), such as Claude Code, start this command.
    """
    from codebotler.agents import server
    from codebotler.agents.gatekeeper import Gatekeeper
    from codebotler.cli.operating.serving import open_console
    from codebotler.core.terminal import note
    from codebotler.models.recorded import is_recorded
    from codebotler.web.security.access import AGENT_PATH, Access, PageAddress
    from codebotler.web.server import serve

    asks = not http if ask_client is None else ask_client
    if agent_token is not None and not http:
        given = "--agent-token or CODEBOTLER_AGENT_TOKEN"
        raise UserError(f"{given} needs --http; add --http, or give no token for agents")
    streams = None if http else server.take_streams()
    console = open_console(model, base_url, shared, candidates=candidates)
    writes = bool(model) or not is_recorded(console.models[0])
    gatekeeper = Gatekeeper(console, asks_client=asks, writes=writes)
    agents = server.make_server(gatekeeper)
    access = Access.from_options(token, agent=agent_token)

    def announce(address: str) -> None:
        gatekeeper.page = address
        if http:
            note(f"Agents use {address}{AGENT_PATH[1:]} with\n\n    Authorization: Bearer {access.agent}\n")

    if streams is None:
        companion = server.over_http(agents, announce)
    else:
        companion = server.over_stdio(agents, streams, announce)
    serve(console, PageAddress(port=port), access, companion=companion)
