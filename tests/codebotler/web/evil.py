"""Hostile texts that a robot, a model or a world might say to attack a page."""

EVIL = [
    '<script>window.owned = 1</script><img src=x onerror="window.owned = 1">',
    "[a link](javascript:window.owned=1) **bold** `code` שלום עולם \u202e gnp.exe \u2066 مرحبا",
    "</textarea></script><svg onload=window.owned=1>'\"`--></style>\x1b[31mred\x00\u2028\ud800\U0001f916",
    "{{ constructor.constructor('window.owned = 1')() }} ${window.owned = 1} " + "long " * 20_000,
]
"""Each attacks within its first 80 characters, since names are not longer."""

NAMES = ["markup", "direction", "tags", "long"]

OWN_TAGS = (
    "script, img:not(.cm-widgetBuffer), iframe, object, embed, a[href^='javascript'], svg [onload], [onerror]"
)
"""A selector of elements that could run code."""
