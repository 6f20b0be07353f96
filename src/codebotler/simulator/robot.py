"""The simulated robot: what each skill does to a world, and how it can fail."""

from __future__ import annotations

import json
from _blake2 import blake2b  # of `hashlib`, which would bring OpenSSL into every child
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn, Protocol, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.calling import call_skill
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import Scalar, as_text, plain, sample_values, written_call
from codebotler.core.trace import Event, Option, Trace, attempted_event, to_options
from codebotler.core.world import Answer, Person, World
from codebotler.simulator.fact_sampler import FactSampler
from codebotler.simulator.settings import (
    PAPER,
    Matching,
    SimulationSettings,
    choose,
    finds,
    is_called,
    resolve_room,
)

Argument: TypeAlias = Scalar | tuple[Option, ...] | tuple[Scalar, ...]
Result: TypeAlias = Scalar | list[str] | list[Scalar] | None
Setup: TypeAlias = tuple[str, tuple[Any, ...]]  # of a copy: `simulated` or `sampled`, and the arguments


class SkillGuard(Protocol):
    """Judges each skill before a robot executes it."""

    may_refuse: bool

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill, or raise RobotError."""

    def judge_inside(self, robot: SimulatedRobot, event: Event) -> None:
        """Judge what a skill of the user's own is about to do inside, or raise RobotError."""

    def at_end(self) -> RobotError | None:
        """Return what is wrong if the run ends now."""


@dataclass
class Thing:
    """An object in a room."""

    label: str
    is_pattern: bool = True  # one that was put down keeps the name it was picked by, as literal text

    def is_meant_by(self, request: str, matching: Matching = "label-in-request") -> bool:
        """Whether a request finds it."""
        if self.is_pattern:
            return finds(request, self.label, matching)
        return self.label.lower() in request.lower()  # a regex would take minutes for names that are long


class Somebody:
    """A person in a room, what they have yet to answer, and when they come."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self.answers = [*person.answers]
        self.looks_before = person.after_looks
        self.is_gone = False

    @property
    def is_here(self) -> bool:
        """Whether they are in the room now."""
        return self.looks_before == 0 and not self.is_gone

    def answer(self, question: str, rules: SimulationSettings) -> Answer | None:
        """What they answer, if anything."""
        for topic, answer in self.person.topics:
            if finds(question, topic, rules.matching):
                return answer
        if not self.answers:
            return None
        answer = self.answers[0]
        if len(self.answers) > 1:  # the last answer stays for ever
            del self.answers[0]
        else:
            self.is_gone = self.person.leaves
        return answer


class SimulatedRobot:
    """A robot in its own copy of a world, with the trace of what it has done."""

    def __init__(
        self,
        world: World,
        rules: SimulationSettings = PAPER,
        skills: SkillTable = SKILLS,
        *,
        guard: SkillGuard | None = None,
    ) -> None:
        self.guard = guard
        self.world, self.rules, self.skills = world, rules, skills
        self.setup: Setup = ("simulated", (world, rules))
        missing = () if skills is SKILLS else [name for name, row in skills.items() if row.does is None]
        if missing:
            raise UserError(f'the skill "{missing[0]}" cannot be simulated: nothing says what it does')
        self.rooms = tuple(room.name for room in world.rooms)
        self.room = world.robot
        self.held: str | None = None
        self.taken: Thing | None = None
        self.now, self.is_live = 0.0, False
        self.line: int | None = None
        self._at_work: Skill | None = None  # one of a user's own
        self.events: list[Event] = []

    # Made when they are first needed: whose run is remembered needs neither.

    @cached_property
    def things(self) -> dict[str, list[Thing]]:
        """The objects in each room."""
        return {room.name: [Thing(label) for label in room.objects] for room in self.world.rooms}

    @cached_property
    def people(self) -> dict[str, list[Somebody]]:
        """The people in each room, also those who have yet to come."""
        return {room.name: [Somebody(person) for person in room.people] for room in self.world.rooms}

    @property
    def trace(self) -> Trace:
        """What the robot has done so far."""
        return tuple(self.events)

    @property
    def own_skills(self) -> tuple[str, ...]:
        """The skills that a copy made from `setup` would not have: they were declared elsewhere."""
        return own_skills(self, SimulatedRobot)

    @property
    def idle_skills(self) -> frozenset[str]:
        """The skills that leave the robot and its world as they are, however often they are executed."""
        someone_may_come = any(one.looks_before for here in self.people.values() for one in here)
        return self.skills.idle - {"is_in_room"} if someone_may_come else self.skills.idle

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill; a question is answered by the position of the chosen option."""
        if self.guard is not None:
            return self.guard.perform(self, skill, arguments)
        return self.execute(skill, arguments)

    def meant_rooms(self, request: str) -> Sequence[str]:
        """All rooms that a request may mean: only those where it leads, if it is the name of one."""
        wanted = request.strip().lower()
        named = [room for room in self.rooms if room.lower() == wanted]
        if named:
            leads_to = resolve_room(self.rooms, request, self.rules.matching)
            return [*named, *([] if leads_to is None else [leads_to])]
        return [room for room in self.rooms if finds(request, room, self.rules.matching)]

    def execute(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """The same, whatever rules say."""
        row = self.skills[skill]
        assert row.does is not None, "the robot was made with it"
        if row.adds_event or row.fails:
            return self._own(row, arguments)
        result: Result = row.does(self, *arguments)
        if isinstance(result, bool) and self.events and self.events[-1].found is None:
            self._add_result(skill, found=result)
        return result

    def _add_result(self, skill: str, *, found: bool) -> None:
        """Add to the event of a skill what it returned, where its behaviour has not done so."""
        recording, last = self.skills[skill].recording, self.events[-1]
        if recording is not None and last.kind == recording.kind:
            self.events[-1] = replace(last, found=found)

    # --- what skills do

    def drive(self, location: str) -> None:
        """Drive to the first room whose name is found in the request."""
        room = self.room_for(location)
        if self.rules.events == "as-requested":
            self.record(GOTO, location, destination=room)
        elif room is not None:
            self.record(GOTO, room, destination=room)
        if room is None:
            raise no_room(location)
        self.room = room

    def room_for(self, request: str) -> str | None:
        """The first room whose name is found in a request; None if there is no such room."""
        return resolve_room(self.rooms, request, self.rules.matching)

    def look(self, entity: str) -> bool:
        """Look for an object, else for a person; who was not there may come after looks in vain."""
        rules, here = self.rules, self.people[self.room]
        seen = any(thing.is_meant_by(entity, rules.matching) for thing in self.things[self.room])
        seen = seen or any(one.is_here and is_called(one.person, entity, rules) for one in here)
        self.record(CHECK, entity, found=seen)
        if not any(one.is_here for one in here) and (
            coming := next((o for o in here if not o.is_gone), None)
        ):
            coming.looks_before -= 1
        return seen

    def ask(self, person: str, question: str, options: Sequence[object]) -> int:
        """Ask the first person here who is meant, and return the position of the option they choose."""
        person, options = as_text(person), to_options(options)
        self.record(ASK, question, options, to=person)
        if not options:
            raise RobotError("AskEmptyOptions", f'the question "{question}" offers no options')
        here = (one for one in self.people[self.room] if one.is_here)
        asked = next((one for one in here if is_called(one.person, person, self.rules)), None)
        if asked is None:
            raise RobotError("AskNoPerson", f'nobody is in "{self.room}" to be asked "{question}"')
        answer = asked.answer(question, self.rules)
        chosen = None if answer is None else choose(answer, question, options, self.rules)
        if chosen is None:
            offered = ", ".join(option.text for option in options)
            raise RobotError(
                "AskInvalidOptions", f'none of the options ({offered}) fits the answer to "{question}"'
            )
        self.amend(options[chosen].text)
        return chosen

    def take(self, obj: str) -> None:
        """Take the first object here that the request finds."""
        if self.held is not None:
            raise RobotError(
                "PickWhileHolding", f'the robot holds "{self.held}" and cannot pick up "{obj}" as well'
            )
        here = self.things[self.room]
        thing = next((thing for thing in here if thing.is_meant_by(obj, self.rules.matching)), None)
        if thing is None:
            raise RobotError("PickInvalidObject", f'there is no "{obj}" in "{self.room}"')
        self.record(PICK, obj if self.rules.events == "as-requested" else thing.label)
        here.remove(thing)
        self.held, self.taken = obj, thing

    def put(self, obj: str) -> None:
        """Put down what the robot holds, which must be named as it was picked up.

        Where events are recorded as they happened, any name that finds what it holds will do.
        """
        taken = self.taken if self.rules.events == "as-happened" else None
        is_meant = taken is not None and taken.is_meant_by(obj, self.rules.matching)
        if self.held is None or (self.held != obj and not is_meant):
            holds = "nothing" if self.held is None else f'"{self.held}"'
            raise RobotError("PlaceNoObject", f'the robot cannot place "{obj}": it holds {holds}')
        self.record(PLACE, taken.label if taken else obj)
        self.things[self.room].append(taken or Thing(obj, is_pattern=False))
        self.held = self.taken = None

    # --- skills of a user's own

    @cached_property
    def state(self) -> dict[str, Any]:
        """What skills remember from one call to the next."""
        return {}

    def truth(self, statement: str) -> bool:
        """Whether a statement is true in this world."""
        known = dict(self.world.truths).get(statement)
        if known is None:
            return self.lot(f'"{statement}"', ("is true", "is not true")) == 0
        if not isinstance(known, bool):
            raise UserError(f'the world says that "{statement}" is {known!r}; write true or false')
        return known

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - of the skill's type
        """What comes of a skill of which nobody says what it does: a result of its type, or its error."""
        row, call = self.skills[skill], written_call(skill, plain(arguments))
        known, kinds = dict(self.world.truths).get(call), [kind for kind, _ in row.fails]
        if known in kinds:
            self.fail(str(known))
        if known is not None:
            if not row.returns.fits(known):
                raise UserError(
                    f"the world says that {call} gives {known!r}; {skill} returns {row.returns.words}"
                )
            return plain(known)
        asks = [one for one, parameter in zip(arguments, row.parameters, strict=True) if parameter.is_options]
        results = tuple(asks[0]) if asks and asks[0] else sample_values(row.returns)
        if len(results) == 1 and not row.fails:
            return results[0]
        words = [f"gives {result!r}" if result is not None else "works" for result in results]
        number = self.lot(call, words, [f"fails: {when}" for _, when in row.fails])
        if number >= len(results):
            self.fail(kinds[number - len(results)])
        return results[number]

    def fail(self, kind: str) -> NoReturn:
        """End a skill with an error that it declares."""
        row = self._at_work
        declared = {} if row is None else dict(row.fails)
        if row is not None and kind in declared:
            raise RobotError(kind, f"{row.name}: {declared[kind]}")
        from difflib import get_close_matches  # noqa: PLC0415 - children have no use for it

        alike = get_close_matches(kind, declared, 1)
        hint = f"did you mean {alike[0]}?" if alike else "name it in `fails`, with the clause that says when"
        sentence = f'{row.name if row else "the skill"} declares no error "{kind}"; {hint}'
        if row is None:
            raise UserError(sentence)
        row.wrong(sentence)

    def lot(self, statement: str, outcomes: Sequence[str], _errors: Sequence[str] = ()) -> int:
        """Draw which of some outcomes a statement has in this world: the same one each time."""
        return self._lots.draw(len(outcomes), statement)

    @cached_property
    def _lots(self) -> FactSampler:
        world = json.dumps(self.world.to_data(), sort_keys=True)
        return FactSampler(int.from_bytes(blake2b(world.encode(), digest_size=8).digest(), "big"))

    def _own(self, row: Skill, arguments: Sequence[Argument]) -> Result:
        """Execute a skill that adds no event by itself, and add it."""
        event, at = None, len(self.events)
        if row.adds_event:
            event = attempted_event(row, arguments, place=self.room, time=self.now, holding=self.held or "")
        is_tried = row.recording is not None and row.recording.when_tried
        if event is not None and is_tried:
            self.events.append(event)
        if event is not None and row.is_drive and self.room_for(event.text) is None:
            raise no_room(event.text)
        self._at_work = row
        result: Result = call_skill(row, self, arguments)
        if event is not None:
            if not is_tried:
                at = len(self.events)
                self.events.append(event)
            if row.is_drive:
                event = self.events[at] = replace(event, destination=self.room)
            if event.options:
                chosen = next(n for n, option in enumerate(event.options) if option.text == result)
                self.events[at] = replace(event, answer=event.options[chosen].text)
                return chosen
            if isinstance(result, bool):
                self.events[at] = replace(event, found=result)
        return result

    # --- the trace

    def sleep_until(self, now: float) -> None:
        """Let simulated time pass, until `now` seconds since the start."""
        self.now = now

    def record(
        self,
        kind: str,
        text: str,
        options: Sequence[object] = (),
        *,
        found: bool | None = None,
        to: str | None = None,
        destination: str | None = None,
    ) -> None:
        """Add an event that happens here and now; the text loses the spaces at its ends."""
        given = text.strip(), to_options(options), None, found
        event = Event(kind, *given, self.room, self.now, self.held or "", to, destination=destination)
        if self.guard is not None:
            self.guard.judge_inside(self, event)
        self.events.append(event)

    def repeat(self, events: Sequence[Event]) -> None:
        """Add events that happened here before, and happen again now."""
        for event in events:
            seen = event.kind, event.text, event.options, event.answer, event.found
            self.events.append(Event(*seen, self.room, self.now, event.holding, event.to))

    def amend(self, answer: str) -> None:
        """Add to the last event what was answered."""
        last = self.events[-1]
        asked = last.kind, last.text, last.options, answer, last.found
        self.events[-1] = Event(*asked, last.place, last.time, last.holding, last.to)


def own_skills(robot: SimulatedRobot, kind: type[SimulatedRobot]) -> tuple[str, ...]:
    """The skills of a robot that those of its kind do not have, or have in another way."""
    if type(robot) is not kind:
        return tuple(robot.skills)
    if robot.skills is SKILLS:
        return ()
    return tuple(name for name, row in robot.skills.items() if row.does is not _USUAL.get(name))


_USUAL = {name: row.does for name, row in SKILLS.items()}


def no_room(location: str) -> RobotError:
    """The error of a drive to what is no room."""
    return RobotError("GoToInvalidLocation", f'there is no room "{location}"')
