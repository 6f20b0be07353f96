"""What people and agents see of a mission while it runs."""
