"""How good are language models at writing programs for service robots?"""
