"""Missions on disk: logs, summaries, pictures, and exports for robotics tools."""
