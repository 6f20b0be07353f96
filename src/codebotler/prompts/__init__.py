"""Write prompts for models from the text files in this folder, and read programs from replies."""

from codebotler.prompts.rendering import (
    NO_STEP,
    PictureMessage,
    Prompt,
    PromptMessage,
    clean_instruction,
    prompt_for,
    template_hash,
)

__all__ = [
    "NO_STEP",
    "PictureMessage",
    "Prompt",
    "PromptMessage",
    "clean_instruction",
    "prompt_for",
    "template_hash",
]
