"""Mutation operators, grouped by kind of mistake; every public function of a module is an operator."""
