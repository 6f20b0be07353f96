"""Prompts for models, from text files in this folder, and programs in their replies."""

from codebotler.prompts.rendering import (
    PictureMessage,
    Prompt,
    PromptMessage,
    clean_instruction,
    prompt_for,
    template_hash,
)

__all__ = ["PictureMessage", "Prompt", "PromptMessage", "clean_instruction", "prompt_for", "template_hash"]
