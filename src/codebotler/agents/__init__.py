"""Agents: other programs, such as Claude Code, propose missions over MCP, and a person approves them."""
