"""The site's search works when opened from a folder, where browsers start no worker."""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Browser

ROOT = Path(__file__).parent.parent.parent
WORKER = "self.onmessage = (sent) => { sent.data.list.push('answered'); self.postMessage(sent.data); };"
ASK = """() => new Promise((answered, failed) => {
    const worker = new Worker("./worker.js");
    const question = { list: ["asked"] };
    worker.onmessage = (sent) => { worker.terminate(); answered([question.list, sent.data.list]); };
    worker.onerror = () => failed("no worker");
    worker.postMessage(question);
})"""
MISSING = """() => new Promise((failed) => {
    const worker = new Worker("./none.js");
    worker.onerror = () => failed("no worker");
    worker.postMessage({});
})"""


def test_a_worker_answers_in_a_folder(browser: Browser, tmp_path: Path) -> None:
    """Messages are copied, like those of a worker, and nothing is left after its end."""
    folder = tmp_path / 'a "folder" & more'
    folder.mkdir()
    shutil.copy(ROOT / "website" / "iframe-worker.js", folder)
    (folder / "worker.js").write_text(WORKER)
    (folder / "index.html").write_text('<!doctype html><body><script src="iframe-worker.js"></script>')
    page = browser.new_page()
    page.goto((folder / "index.html").as_uri())
    assert page.evaluate(ASK) == [["asked"], ["asked", "answered"]]
    assert page.locator("iframe").count() == 0
    assert page.evaluate(MISSING) == "no worker"
    page.close()
