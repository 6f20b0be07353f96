from types import SimpleNamespace
from typing import Any


def made(result: Any) -> Any:
    class Result:
        pass

    if result is not None:
        Result.result = result  # type: ignore[attr-defined]  # as a generated message has it
    return SimpleNamespace(Goal=SimpleNamespace, Result=Result)


GoTo = Say = Pick = Place = made(None)
GetCurrentLocation, Ask = made("hall"), made("yes")
GetAllRooms, IsInRoom = made(["hall", "lab"]), made(result=True)
