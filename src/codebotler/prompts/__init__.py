"""What a model is asked, from text files beside this one, and the program read from its reply."""

from codebotler.prompts.rendering import (
    PictureMessage,
    Prompt,
    PromptMessage,
    prompt_for,
    stated,
    template_hash,
)

__all__ = ["PictureMessage", "Prompt", "PromptMessage", "prompt_for", "stated", "template_hash"]
