"""Mutation operators, a module for each kind; every public function in them is one."""
