"""What a model is told: text files in our own words, and what is made of them for an instruction."""

from codebotler.prompts.rendering import Message, Prompt, Role, Shown, prompt_for, template_hash

__all__ = ["Message", "Prompt", "Role", "Shown", "prompt_for", "template_hash"]
