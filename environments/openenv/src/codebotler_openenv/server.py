"""The server: sessions at /ws, and the other routes of openenv."""

import argparse

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse
from openenv.core.env_server.http_server import create_app

from codebotler.core.errors import UserError
from codebotler_openenv.environment import CodebotlerEnvironment
from codebotler_openenv.models import CodebotlerAction, CodebotlerObservation, CodebotlerState

SESSIONS = 256


def new_app(sessions: int = SESSIONS) -> FastAPI:
    """Create the application for a number of concurrent sessions."""
    created: FastAPI = create_app(
        CodebotlerEnvironment,
        CodebotlerAction,
        CodebotlerObservation,
        env_name="codebotler_env",
        max_concurrent_envs=sessions,
        state_cls=CodebotlerState,
    )
    # Without this handler, plain HTTP responses would lack the message.
    created.add_exception_handler(UserError, _wrong_input)
    return created


def main() -> None:
    """Serve until an interrupt."""
    parser = argparse.ArgumentParser(
        prog="codebotler-openenv", description="Serve RoboEval's training tasks."
    )
    parser.add_argument("--host", default="127.0.0.1", help="the address to listen on (default: %(default)s)")
    parser.add_argument("--port", type=int, default=8000, help="the port (default: %(default)s)")
    parser.add_argument(
        "--sessions", type=int, default=SESSIONS, help="how many at the same time (default: %(default)s)"
    )
    given = parser.parse_args()
    uvicorn.run(new_app(given.sessions), host=given.host, port=given.port)


def _wrong_input(_: Request, error: Exception) -> JSONResponse:
    return JSONResponse({"detail": str(error)}, status_code=400)


app = new_app()

if __name__ == "__main__":
    main()
