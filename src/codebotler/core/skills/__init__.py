"""Skills: what a robot can do, each declared by one function."""
