"""Write prompts for models, from text files in this folder, and extract programs from their replies."""

from codebotler.prompts.rendering import (
    PictureMessage,
    Prompt,
    PromptMessage,
    clean_instruction,
    prompt_for,
    template_hash,
)

__all__ = ["PictureMessage", "Prompt", "PromptMessage", "clean_instruction", "prompt_for", "template_hash"]
