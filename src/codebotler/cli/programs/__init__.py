"""The commands that work with programs, rules and skills, without a robot."""
