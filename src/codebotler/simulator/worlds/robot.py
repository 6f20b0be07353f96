"""The simulated robot: executes skills in a copy of a world, and raises their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NoReturn, Protocol, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.calling import call_skill
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import Scalar, as_text, plain, sample_values, written_call
from codebotler.core.trace import Event, Option, Trace, attempted_event, to_options
from codebotler.core.world import World
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings, choose
from codebotler.simulator.worlds.entities import Thing
from codebotler.simulator.worlds.simulated_world import NO_SUCH_THING, SimulatedWorld, unknown_room

Argument: TypeAlias = Scalar | tuple[Option, ...] | tuple[Scalar, ...]
Result: TypeAlias = Scalar | list[str] | list[Scalar] | None
Setup: TypeAlias = tuple[str, tuple[Any, ...]]  # `simulated` or `sampled`, and the arguments to make a copy


class SkillGuard(Protocol):
    """Allows or forbids each skill call before a robot executes it; `RuleGuard` implements this."""

    may_refuse: bool

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill, or raise RobotError if it is forbidden."""

    def judge_inside(self, robot: SimulatedRobot, event: Event) -> None:
        """Raise RobotError if a house rule forbids the next event inside a custom skill."""

    def find_first_unkept(self) -> RobotError | None:
        """Return an error for the first rule that would be broken if the run ended now, or None."""


class SimulatedRobot(SimulatedWorld):
    """A robot that acts in its own copy of a world and records a trace."""

    is_copied = True  # whether a batch's child can copy it; each subclass must set this itself

    def __init__(
        self,
        world: World,
        settings: SimulationSettings = PAPER_SETTINGS,
        skills: SkillTable = SKILLS,
        *,
        guard: SkillGuard | None = None,
    ) -> None:
        super().__init__(world, settings)
        self.guard, self.skills = guard, skills
        self.setup: Setup = ("simulated", (world, settings))
        missing = () if skills is SKILLS else [name for name, row in skills.items() if row.does is None]
        if missing:
            raise UserError(f'the skill "{missing[0]}" cannot be simulated because it has no code; add code')
        self.held: str | None = None
        self.taken: Thing | None = None
        self.now, self.is_live = 0.0, False
        self.line: int | None = None
        self._own_skill: Skill | None = None  # a custom skill that is being executed
        self.events: list[Event] = []

    @property
    def trace(self) -> Trace:
        """The events of the run so far, in order."""
        return tuple(self.events)

    @property
    def own_skills(self) -> tuple[str, ...]:
        """The skills, such as custom ones, that a copy of this robot in another process cannot execute."""
        if "is_copied" not in vars(type(self)):
            return tuple(self.skills)
        if self.skills is SKILLS:
            return ()
        return tuple(name for name, row in self.skills.items() if row.does is not _USUAL.get(name))

    @property
    def idle_skills(self) -> frozenset[str]:
        """The names of the skills that change neither the robot nor its world, such as `get_all_rooms`."""
        someone_may_come = any(one.looks_before for here in self.occupants.values() for one in here)
        return self.skills.idle - {"is_in_room"} if someone_may_come else self.skills.idle

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill if the guard allows it. A question returns the position of the chosen option."""
        if self.guard is not None:
            return self.guard.perform(self, skill, arguments)
        return self.execute(skill, arguments)

    def execute(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill as `perform` does, but without asking the guard."""
        row = self.skills[skill]
        assert row.does is not None, "the constructor checks this"
        if row.adds_event or row.fails:
            return self._own(row, arguments)
        result: Result = row.does(self, *arguments)
        if isinstance(result, bool) and self.events and self.events[-1].found is None:
            recording, last = row.recording, self.events[-1]
            if recording is not None and last.kind == recording.kind:
                self.events[-1] = replace(last, found=result)
        return result

    # --- effects of skills

    def drive(self, location: str) -> None:
        """Drive to the room that a request means. Raise RobotError if it means none or may mean several."""
        room = self.room_for(location)
        goal = None if room is None else self.full_names.get(room, room)
        if self.settings.events == "as-requested":
            self.record(GOTO, location, destination=goal)
        elif goal is not None:
            self.record(GOTO, goal, destination=goal)
        if room is None:
            raise unknown_room(location, self.possible_rooms(location))
        self.room = room

    def look(self, entity: str) -> bool:
        """Return whether an object or person is in this room. Some people arrive only after several looks."""
        settings, people = self.settings, self.people_here
        seen = any(thing.is_meant_by(entity, settings.matching) for thing in self.things_here)
        seen = seen or any(one.is_here and one.is_meant_by(entity, settings) for one in people)
        self.record(CHECK, entity, found=seen)
        coming = next((one for one in people if not one.is_gone), None)
        if coming is not None and not any(one.is_here for one in people):
            coming.looks_before -= 1
        return seen

    @property
    def may_others_be_here(self) -> bool:
        """Whether somebody may be in this room although nobody fits a request."""
        return self.settings.matching == "longest-name" and any(one.is_here for one in self.people_here)

    def ask(self, person: str, question: str, options: Sequence[object]) -> int:
        """Ask the first matching person in this room, and return the position of the option they choose."""
        person, options = as_text(person), to_options(options)
        self.record(ASK, question, options, to=person)
        if not options:
            raise RobotError("AskEmptyOptions", f'the question "{question}" offers no options')
        asked = self.person_meant(person)
        if asked is None:
            fits = f'nobody in "{self.room}" fits "{person}"'
            nobody = fits if self.may_others_be_here else f'nobody is in "{self.room}"'
            raise RobotError("AskNoPerson", f'{nobody}, so nobody can answer "{question}"')
        answer = asked.answer(question, self.settings)
        chosen = None if answer is None else choose(answer, question, options, self.settings)
        if chosen is None:
            offered = ", ".join(option.text for option in options)
            message = f'none of the options ({offered}) fits the answer to "{question}"'
            raise RobotError("AskInvalidOptions", message)
        self.amend(options[chosen].text)
        return chosen

    def take(self, obj: str) -> None:
        """Pick up the first matching object in this room. Raise RobotError if there is none."""
        if self.held is not None:
            message = f'the robot holds "{self.held}" and cannot pick up "{obj}" as well'
            raise RobotError("PickWhileHolding", message)
        thing = self.thing_meant(obj)
        if thing is None:
            raise RobotError(NO_SUCH_THING, f'there is no "{obj}" in "{self.room}"')
        self.record(PICK, obj if self.settings.events == "as-requested" else thing.label)
        here = next(things for things in self.contents.values() if any(one is thing for one in things))
        here.remove(thing)
        self.held, self.taken = obj, thing

    def put(self, obj: str) -> None:
        """Put down the held object, named as in `take` (or by any fitting name with `as-happened` events)."""
        taken = self.taken if self.settings.events == "as-happened" else None
        is_meant = taken is not None and taken.is_meant_by(obj, self.settings.matching)
        if self.held is None or (self.held != obj and not is_meant):
            holds = "nothing" if self.held is None else f'"{self.held}"'
            raise RobotError("PlaceNoObject", f'the robot cannot place "{obj}": it holds {holds}')
        self.record(PLACE, taken.label if taken else obj)
        same = self.taken if self.settings.matching == "longest-name" else taken
        self.contents[self.room].append(same or Thing(obj, is_pattern=False))
        self.held = self.taken = None

    # --- custom skills

    @cached_property
    def state(self) -> dict[str, Any]:
        """The values that custom skills store between calls."""
        return {}

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - a skill may return any type
        """Return the result of a skill without code: the value that the world sets, or else a random one."""
        row, call = self.skills[skill], written_call(skill, plain(arguments))
        known, kinds = self._truths.get(call.casefold()), [kind for kind, _ in row.fails]
        if known in kinds:
            self.fail(str(known))
        if known is not None:
            if not row.returns.fits(known):
                must = f"{skill} must return {row.returns.in_words}"
                raise UserError(f"the world sets {call} to {known!r}, but {must}")
            return plain(known)
        asks = [one for one, parameter in zip(arguments, row.parameters, strict=True) if parameter.is_options]
        names = self.known_names(row.returns.names) if row.returns.names else ()
        results = tuple(asks[0]) if asks and asks[0] else sample_values(row.returns, names)
        if len(results) == 1 and not row.fails:
            return results[0]
        words = [f"gives {result!r}" if result is not None else "works" for result in results]
        number = self.draw_outcome(call, words, [f"fails: {when}" for _, when in row.fails])
        if number >= len(results):
            self.fail(kinds[number - len(results)])
        return results[number]

    def fail(self, kind: str) -> NoReturn:
        """Raise a RobotError of this kind, or UserError if the skill does not declare the kind in `fails`."""
        row = self._own_skill
        if row is None:
            raise UserError(f'`fail("{kind}")` was called outside a skill; call it only in a skill')
        declared = dict(row.fails)
        if kind not in declared:
            row.wrong(f'{row.name} declares no error "{kind}"; add it to `fails`, and say when it happens')
        raise RobotError(kind, f"{row.name}: {declared[kind]}")

    def _own(self, row: Skill, arguments: Sequence[Argument]) -> Result:
        """Execute a custom skill, and record its event."""
        event, at = None, len(self.events)
        if row.adds_event:
            event = attempted_event(row, arguments, place=self.place, time=self.now, holding=self.held or "")
        is_tried = row.recording is not None and row.recording.when_tried
        if event is not None and is_tried:
            self.events.append(event)
        if event is not None and row.is_drive and self.room_for(event.text) is None:
            raise unknown_room(event.text, self.possible_rooms(event.text))
        self._own_skill = row
        result: Result = call_skill(row, self, arguments)
        if event is not None:
            if not is_tried:
                at = len(self.events)
                self.events.append(event)
            if row.is_drive:
                event = self.events[at] = replace(event, destination=self.place)
            if event.options:
                chosen = next(n for n, option in enumerate(event.options) if option.text == result)
                self.events[at] = replace(event, answer=event.options[chosen].text)
                return chosen
            if isinstance(result, bool):
                self.events[at] = replace(event, found=result)
        return result

    # --- the trace

    def sleep_until(self, now: float) -> None:
        """Set simulated time to `now` seconds since the start of the run."""
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
        """Add an event to the trace, at the robot's place and time. The arguments are fields of `Event`."""
        given = text.strip(), to_options(options), None, found
        event = Event(kind, *given, self.place, self.now, self.held or "", to, destination=destination)
        if self.guard is not None:
            self.guard.judge_inside(self, event)
        self.events.append(event)

    def repeat(self, events: Sequence[Event]) -> None:
        """Add copies of earlier events in this room to the trace, at the current time."""
        self.events += [replace(event, time=self.now) for event in events]

    def amend(self, answer: str) -> None:
        """Add the answer to the last event of the trace, which must be a question."""
        self.events[-1] = replace(self.events[-1], answer=answer)


_USUAL = {name: row.does for name, row in SKILLS.items()}
