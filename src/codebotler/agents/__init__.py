"""Agents: other programs that use the robot over MCP, and whose missions a person approves."""
