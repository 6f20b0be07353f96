"""Mutation operators, grouped by kind of mistake. Every public function of a module is an operator."""
