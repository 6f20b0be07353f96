"""Limits and retries work against a real server."""

import asyncio
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from itertools import pairwise
from typing import Any, TypeVar

import pytest

from codebotler.core.errors import UserError
from codebotler.models.base import BudgetSpentError, ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for
from server import Fault, Request, Server

T = TypeVar("T")
PROMPT = prompt_for("Go to the lobby.")
CHAT, BASE = "openai-chat:m", "completions:m"
both = pytest.mark.parametrize("name", [CHAT, BASE])


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with Server() as served:
        yield served


def use(
    server: Server,
    work: Callable[[RateLimited], Awaitable[T]],
    *,
    name: str = BASE,
    timeout: float = 30,
    **limits: Any,  # noqa: ANN401 - of several types
) -> tuple[RateLimited, T]:
    async def run() -> tuple[RateLimited, T]:
        model = open_model(name, SamplingSettings(base_url=server.url, seed=0, timeout=timeout))
        paced = RateLimited(model, first_wait=0.01, **limits)
        assert paced.model.name == name
        try:
            return paced, await work(paced)
        finally:
            await paced.close()

    return asyncio.run(run())


async def ask_once(paced: RateLimited) -> Reply:
    return await paced.reply(PROMPT, number=0)


def ask_many(count: int) -> Callable[[RateLimited], Awaitable[list[Reply]]]:
    async def ask(paced: RateLimited) -> list[Reply]:
        return await asyncio.gather(*(paced.reply(PROMPT, number=number) for number in range(count)))

    return ask


PASSING = [
    Fault.TOO_MANY,
    Fault.SERVER_ERROR,
    Fault.SLOW,
    Fault.STALLED,
    Fault.HUNG_UP,
    Fault.CUT,
    Fault.CUT_IN_ORDER,
    Fault.ERROR_IN_STREAM,
    Fault.INVALID_JSON,
    Fault.NOTHING,
    Fault.WRONG_TYPE,
]


@both
@pytest.mark.parametrize("fault", PASSING, ids=lambda fault: fault.name)
def test_passing_faults_are_retried(name: str, server: Server, fault: Fault) -> None:
    server.faults.extend([fault, fault])
    paced, reply = use(server, ask_once, name=name, timeout=1 if fault in {Fault.SLOW, Fault.STALLED} else 30)
    assert "reply 0" in reply.program
    assert (paced.requests, paced.retry_count) == (3, 2)
    assert len(server.requests) == 3


def test_first_retry_is_logged_once(server: Server, caplog: pytest.LogCaptureFixture) -> None:
    server.faults.extend([Fault.HUNG_UP, Fault.HUNG_UP])
    use(server, ask_once)
    (message,) = caplog.messages
    assert "again" in message
    assert message.endswith("(Server disconnected without sending a response)")


def test_later_retries_are_not_logged(server: Server, caplog: pytest.LogCaptureFixture) -> None:
    async def two(paced: RateLimited) -> int:
        await paced.reply(prompt_for("x"), number=0)
        server.faults.append(Fault.HUNG_UP)
        await paced.reply(prompt_for("x"), number=1)
        return paced.retry_count

    assert use(server, two)[1] == 1
    assert caplog.messages == []


@both
@pytest.mark.parametrize(
    "fault",
    [Fault.UNAUTHORIZED, Fault.NOT_FOUND, Fault.NO_MONEY, Fault.TOO_LONG],
    ids=lambda fault: fault.name,
)
def test_lasting_faults_are_not_retried(name: str, server: Server, fault: Fault) -> None:
    server.faults.append(fault)
    with pytest.raises(ModelError) as caught:
        use(server, ask_once, name=name)
    assert "tried" not in caught.value.sentence
    assert len(server.requests) == 1


@both
@pytest.mark.parametrize("fault", [Fault.EMPTY, Fault.WITHOUT_CODE], ids=lambda fault: fault.name)
def test_reply_without_a_program_is_not_retried(name: str, server: Server, fault: Fault) -> None:
    server.faults.append(fault)
    paced, _ = use(server, ask_once, name=name)
    assert (paced.requests, paced.retry_count, len(server.requests)) == (1, 0, 1)


def test_retries_are_limited(server: Server) -> None:
    server.fault = lambda _request: Fault.SERVER_ERROR
    with pytest.raises(ModelError) as caught:
        use(server, ask_once, retries=2)
    assert caught.value.sentence.endswith("(tried 3 times)")
    assert caught.value.is_temporary
    assert len(server.requests) == 3


def test_waits_grow(server: Server) -> None:
    server.faults.extend([Fault.SERVER_ERROR] * 5)
    use(server, ask_once)
    starts = [request.at for request in server.requests]
    waits = [later - earlier for earlier, later in pairwise(starts)]
    assert len(waits) == 5
    for exponent, wait in enumerate(waits):
        assert wait >= 0.01 * 2**exponent


@both
def test_retry_after_delays_all_requests(name: str, server: Server) -> None:
    server.faults.append(Fault.TOO_MANY_FOR_A_WHILE)
    server.retry_after = 1

    async def ask(paced: RateLimited) -> None:
        first = asyncio.create_task(paced.reply(PROMPT, number=0))
        while not paced.retry_count:  # noqa: ASYNC110 - the counter has no event
            await asyncio.sleep(0.005)
        await asyncio.gather(first, *(paced.reply(PROMPT, number=number) for number in range(3)))

    use(server, ask, name=name)
    refused, *later = server.requests
    assert len(later) == 4
    assert all(0.98 < request.at - refused.at < 10 for request in later)


def test_too_long_retry_after_is_an_error(server: Server) -> None:
    server.faults.append(Fault.TOO_MANY_FOR_A_WHILE)
    server.retry_after = 3600
    with pytest.raises(ModelError) as caught:
        use(server, ask_once)
    assert caught.value.retry_after == 3600


def test_no_more_requests_are_under_way_than_allowed(server: Server) -> None:
    server.pause = 0.1
    _, replies = use(server, ask_many(12), concurrency=3)
    assert len(replies) == 12
    assert server.most_open == 3


def test_requests_and_retries_are_spread_over_the_minute(server: Server) -> None:
    server.faults.extend([None, Fault.SERVER_ERROR])
    paced, _ = use(server, ask_many(5), requests_per_minute=1200)
    assert paced.requests == 6
    starts = [request.at for request in server.requests]
    assert starts[-1] - starts[0] > 4 * 0.05


def test_counters_add_up(server: Server) -> None:
    paced, replies = use(server, ask_many(5))
    assert (paced.requests, paced.retry_count) == (5, 0)
    assert paced.tokens_used == sum(reply.usage.total for reply in replies)


def spend(paced: RateLimited) -> Awaitable[tuple[int, BudgetSpentError]]:
    async def run() -> tuple[int, BudgetSpentError]:
        for number in range(100):
            try:
                await paced.reply(PROMPT, number=number)
            except BudgetSpentError as error:
                return number, error
        raise AssertionError("the budget is without end")

    return run()


@both
def test_spent_budget_stops_before_a_request(name: str, server: Server) -> None:
    paced, (replies, error) = use(server, spend, name=name, token_budget=5_000)
    each = paced.tokens_used // replies
    assert replies == -(-5_000 // each)
    assert (error.budget, error.used) == (5_000, paced.tokens_used)
    for named in ("token budget", "5,000", f"{paced.tokens_used:,}"):
        assert named in error.sentence
    assert len(server.requests) == paced.requests == replies


class HundredTokens:
    """A model whose replies take a hundred tokens each."""

    name = "hundred"
    settings = SamplingSettings()

    async def reply(self, _prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        on_text(str(number))
        return Reply("", "", Usage(60, 40), 0.0, "stop")

    async def close(self) -> None:
        pass


def test_budget_that_is_used_to_the_last_token_is_spent() -> None:
    async def run() -> tuple[int, BudgetSpentError]:
        return await spend(RateLimited(HundredTokens(), token_budget=200))

    replies, error = asyncio.run(run())
    assert (replies, error.used) == (2, 200)


@both
def test_budget_holds_if_the_server_counts_no_tokens(name: str, server: Server) -> None:
    server.counts = False
    paced, (replies, _) = use(server, spend, name=name, token_budget=5_000)
    assert 2 <= replies <= 6
    assert paced.tokens_used >= 5_000


def test_reply_that_breaks_off_counts_against_the_budget(server: Server) -> None:
    server.fault = lambda _request: Fault.CUT
    with pytest.raises(BudgetSpentError):
        use(server, ask_once, token_budget=100)
    assert len(server.requests) == 1


def test_requests_that_wait_find_the_budget_spent(server: Server) -> None:
    async def ask(paced: RateLimited) -> list[Any]:
        asked = (paced.reply(PROMPT, number=number) for number in range(6))
        return await asyncio.gather(*asked, return_exceptions=True)

    _, ends = use(server, ask, token_budget=10, concurrency=2)
    assert [type(end) for end in ends] == [Reply] * 2 + [BudgetSpentError] * 4
    assert len(server.requests) == 2


def test_spent_budget_is_reported_without_waiting(server: Server) -> None:
    async def ask(paced: RateLimited) -> float:
        await ask_once(paced)
        start = time.monotonic()
        with pytest.raises(BudgetSpentError):
            await ask_once(paced)
        return time.monotonic() - start

    _, seconds = use(server, ask, token_budget=10, requests_per_minute=12)
    assert seconds < 2


def test_budget_that_is_spent_while_a_request_waits_for_its_turn_stops_it(server: Server) -> None:
    async def ask(paced: RateLimited) -> list[Any]:
        return [*await asyncio.gather(ask_once(paced), ask_once(paced), return_exceptions=True)]

    _, ends = use(server, ask, token_budget=10, requests_per_minute=40)
    assert [type(end) for end in ends] == [Reply, BudgetSpentError]
    assert len(server.requests) == 1


def test_cancelled_requests_leave_nothing_behind(server: Server) -> None:
    async def ask(paced: RateLimited) -> Reply:
        server.faults.extend([Fault.SLOW, Fault.SERVER_ERROR, Fault.SLOW])
        tasks = [asyncio.create_task(paced.reply(PROMPT, number=number)) for number in range(6)]
        while len(server.requests) < 4:  # noqa: ASYNC110 - it counts in another thread
            await asyncio.sleep(0.005)
        for task in tasks:
            task.cancel()
        ends = await asyncio.wait_for(asyncio.gather(*tasks, return_exceptions=True), 5)
        assert sum(isinstance(end, asyncio.CancelledError) for end in ends) >= 2
        assert asyncio.all_tasks() == {asyncio.current_task()}
        return await paced.reply(PROMPT, number=0)

    server.pause = 0.2
    _, reply = use(server, ask, concurrency=3, requests_per_minute=6000)
    assert "reply 0" in reply.program


SCRIPT = """
import asyncio, sys
from codebotler.models.sampling import SamplingSettings
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import prompt_for

async def main(name, url):
    model = RateLimited(open_model(name, SamplingSettings(base_url=url)), concurrency=4)
    prompt = prompt_for("Go to the lobby.")
    try:
        await asyncio.gather(*(model.reply(prompt, number=number) for number in range(20)))
    finally:
        await model.close()
        print("closed")

try:
    asyncio.run(main(*sys.argv[1:]))
except KeyboardInterrupt:
    print("stopped")
"""


@pytest.mark.slow
@both
def test_control_c_stops_all_requests_at_once_and_quietly(name: str, server: Server) -> None:
    server.faults.extend([Fault.SLOW, Fault.STALLED] * 10)
    with subprocess.Popen(
        [sys.executable, "-X", "dev", "-c", SCRIPT, name, server.url],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while len(server.requests) < 4 and process.poll() is None:
            time.sleep(0.01)
        time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert output == "closed\nstopped\n", errors
    assert not [line for line in errors.splitlines() if not line.startswith("Executing <")]
    assert len(server.requests) == 4


@pytest.mark.slow
@both
def test_every_reply_comes_once_through_many_faults(name: str, server: Server) -> None:
    dice = random.Random(1)
    bad = [fault for fault in PASSING if fault not in {Fault.SLOW, Fault.STALLED}]

    def fault(_request: Request) -> Fault | None:
        return dice.choice(bad) if dice.random() < 0.2 else None

    server.fault = fault
    paced, replies = use(server, ask_many(100), name=name)
    assert [f'say("reply {number}")' in reply.program for number, reply in enumerate(replies)] == [True] * 100
    assert len(server.requests) == paced.requests == 100 + paced.retry_count
    assert paced.retry_count > 5
    asked = Counter(request.body["seed"] for request in server.requests)
    assert set(asked) == set(range(100))


@pytest.mark.parametrize(
    "limits",
    [{"concurrency": 0}, {"requests_per_minute": 0.0}, {"retries": -1}, {"token_budget": 0}],
    ids=str,
)
def test_limits_out_of_range_are_refused(limits: dict[str, Any]) -> None:
    with pytest.raises(UserError):
        RateLimited(open_model("recorded", SamplingSettings()), **limits)
