"""The commands for operating a robot."""
