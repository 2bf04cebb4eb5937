"""Search for advice that holds when it is followed.

Gains are searched with a reserve. Advised settings get the verdict that users will get, and must hold in fresh runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.progress import note_work
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import words_for
from pretouch._core.warning_codes import split_code
from pretouch.designs import Task
from pretouch.designs.robust.required import Required, limits_of
from pretouch.designs.search import RUNS, Effort, GainAxis
from pretouch.simulation import ClosedLoop, chain_of_fit

from .appraisal import USUAL_MARGIN, LoopProblem, draw_encounters
from .changed_loop import ChangedLoop, candidates_of, loop_at, rate_in_words, rounded_up, with_settings
from .effect import VerdictStatus
from .fresh_runs import fresh_outcomes, fresh_runs, runs_that_show
from .gain_search import GainSearch, stable_axis
from .improvement import Improvements, redesign
from .larger_limits import FIRST_LIMIT, nearest_limits, softer_padding, uninformative_limits, with_limit
from .missed_runs import missed_in_words
from .reasons import lacks_only_runs, misses_required_margin
from .result import Advice, Verdict
from .settings import settings_between
from .stability import Passed, limit_of

Judge: TypeAlias = Callable[[Task], Verdict]
"""Function that returns the verdict on a changed task, as `verify` does."""

_TRIES: Final = 3  # number of gains that are checked on fresh runs, each with more reserve than the one before
_STRICTER: Final = 1.01  # the least increase of the reserve
_STRICTEST: Final = 1.15  # the largest increase of the reserve
_LEAST_MARGIN: Final = 1.1  # smallest gain margin of an advised gain, if none with the usual margin holds
_NEAR: Final = 1.05  # largest shortfall of a quick search after which a loop is searched thoroughly
_QUICK_RUNS: Final = 100
_QUICK: Final = Effort(first=9, largest=9, most=1, nodes=5, finest=2e-2, smooth=False)
_AROUND: Final = 4.0  # a changed loop is searched from the nearest gain divided by this factor to it times the factor
_FILTERS: Final = ("median_window", "moving_average", "low_pass_order", "cutoff", "largest_rate", "floor")
_AGAINST_NOISE: Final = frozenset({"chain.noise", "chain.relative_noise", *(f"controller.{key}" for key in _FILTERS)})
"""Settings that help only against noise. If the noise is a guess, it must be measured first."""


class _Start(NamedTuple):
    """A loop from which changes start, and the changes that led to it."""

    loop: ClosedLoop
    words: tuple[str, ...]
    name: str = ""  # short name of the last change
    before: _Start | None = None  # the loop without the last change


class _Checked(NamedTuple):
    """The result of following an advice."""

    task: Task  # with the advised settings
    verdict: Verdict  # what users will get
    shortfalls: FloatArray  # the shortfall of each requirement, over the user's runs and over fresh ones
    fresh: int  # number of fresh runs

    @property
    def shortfall(self) -> float:
        """The largest shortfall; NaN if the loop could not be simulated."""
        return float(self.shortfalls.max())


def search_advice(task: Task, verdict: Verdict, found: Improvements, passed: Passed, judge: Judge) -> Advice | None:
    """Search for settings with which a verdict holds.

    Args:
        task: the verified task.
        verdict: its verdict.
        found: the best gain on the loop, and changes of the loop.
        passed: the distances that the encounter passes.
        judge: returns the verdict on a changed task.

    Returns:
        The advice; None if the verdict holds and nothing improves it.
    """
    seeker, is_guess = _Seeker(task, verdict, found, passed, judge), _is_noise_a_guess(task)
    if is_guess and verdict.status is VerdictStatus.DOES_NOT_HOLD:
        return seeker.another_gain() or _repeat_readings()
    advice = seeker.advice()
    against_noise = advice is None or advice.kind == "none" or bool(_AGAINST_NOISE & set(advice.settings))
    return _repeat_readings() if is_guess and verdict.reasons and against_noise else advice


def search_at_rate(task: Task, rate: float, judge: Judge) -> Advice | None:
    """Search for settings that hold at the sensor rate with which the optimal gain has the required margin.

    The rate ensures only the margin: because of noise and random encounters, another gain or limit may be needed, too.

    Args:
        task: the verified task with its required gain margin, but without a gain.
        rate: the sensor rate [Hz].
        judge: returns the verdict on a changed task, with its advice.

    Returns:
        The advice; None if the sensor does not reach the rate, or if nothing holds at this rate.
    """
    if not task.loop.chain.rate < rate <= task.largest_sensor_rate or math.isinf(rate):
        return None
    try:
        faster = task.replace(loop=loop_at(task.loop, min(rounded_up(rate), task.largest_sensor_rate)))
        verdict = judge(faster)
    except InvalidInputError:  # the rate does not fit another part of the loop
        return None
    step, settings = _as_step(rate_in_words(task.loop, faster.loop)), settings_between(task, faster)
    if verdict.status.is_passed and verdict.gain is not None:
        count = fresh_runs(faster)
        shortfalls = fresh_outcomes(faster.replace(gain=verdict.gain), count).shortfalls(count, task.verify.confidence)
        checked = _Checked(faster, verdict, shortfalls, count)
        text = f"{step}, with {task.law.number.equals(verdict.gain)}. {_outcome(checked)}"
        more = Advice(kind="change", sentence=text, status=verdict.status, fresh_runs=count)
        return replace(more, settings=settings) if checked.shortfall <= 1 else None
    more = verdict.advice or _repeat_readings()
    if more.kind not in {"change", "limit"} or "chain.rate" in more.settings:
        return None
    return replace(more, sentence=f"{step}, and {more.sentence}", settings={**settings, **more.settings})


def _repeat_readings() -> Advice:
    """Advise to measure the noise before anything that costs more than another gain."""
    text = "read each distance three times or more, and calibrate again: without repeats, the noise of the sensor is a"
    return Advice(kind="readings", sentence=f"{text} guess, and so is every change that reduces noise")


@dataclass(frozen=True, eq=False)
class _Seeker:
    """Search for advice on one verdict."""

    task: Task
    verdict: Verdict
    found: Improvements
    passed: Passed
    judge: Judge
    quick: dict[int, GainSearch] = field(default_factory=dict)

    def advice(self) -> Advice | None:
        """Return the first advice that holds: changes without cost first, then hardware, then a larger limit."""
        if self.verdict.status is not VerdictStatus.DOES_NOT_HOLD:
            return self._improvement()
        for start, search in self._searches():
            note_work(f"checking advice on fresh runs: {', '.join(start.words) or 'another gain'}")
            checked = self._with_best_gain(search)
            if checked is not None:
                return self._change(*self._without_needless(checked, start))
        return self._larger_limit() or self._none()

    def another_gain(self) -> Advice | None:
        """Return the advice to use another gain on the unchanged loop; None if none holds."""
        if self.verdict.at_rest is not None and self.verdict.at_rest.reaches_object:
            return None  # a larger floor is needed, too
        checked = self._with_best_gain(self.found.search)
        return None if checked is None else self._change(checked, ())

    def _improvement(self) -> Advice | None:
        """Return the most helpful change of a loop whose gain holds, if it then holds without reservation."""
        change = next((change for change in self.found.changes if change.helps), None)
        if change is None:
            return None
        loop = next((c.loop for c in self.found.loops if c.name == change.name), self.task.loop)
        checked = self._check(self.task.replace(gain=change.gain, loop=loop))
        if not checked.shortfall <= 1 or checked.verdict.status is not VerdictStatus.HOLDS:
            return None
        words: tuple[str, ...] = () if change.name == "gain" else (_as_step(change.sentence),)
        if self.verdict.status is not VerdictStatus.HOLDS:  # otherwise, the change improves the objective
            unchanged = _Start(self.task.loop, ())
            start = unchanged if change.name == "gain" else _Start(loop, words, change.name, unchanged)
            checked, words = self._without_needless(checked, start)
        advice = self._change(checked, words)
        if self.verdict.status is not VerdictStatus.HOLDS or change.improvement is None:
            return advice
        better = f"{100 * change.improvement:.2g} %"
        return replace(advice, sentence=f"optional, to improve the objective by {better}: {advice.sentence}")

    def _searches(self) -> Iterator[tuple[_Start, GainSearch]]:
        """Yield searches for a gain on the loop and on changed loops, cheapest changes first."""
        start, rest = _Start(self.task.loop, ()), self.verdict.at_rest
        if rest is not None and rest.reaches_object and rest.quiet_floor is not None:
            law: Any = self.task.loop.law
            words = f"set the floor to {rest.quiet_floor:g} instead of {law.conditioning.floor:g}"
            quiet = with_settings(self.task.loop, conditioning={"floor": rest.quiet_floor})
            start = _Start(quiet, (words,), "floor", start)
            yield start, self._search(start.loop)
        else:
            yield start, self.found.search
        free = self._changed(start, is_free=True)
        yield from self._promising(free)
        pairs = [two for one in self._ranked(free)[:2] for two in self._changed(one, is_free=True)]
        yield from self._promising(_each_once(pairs))
        hardware = self._changed(start, is_free=False)
        yield from self._promising(hardware)
        best_free = self._ranked(free)[:1]
        yield from self._promising([two for one in best_free for two in self._changed(one, is_free=False)])
        yield from self._promising(
            _each_once(two for one in self._ranked(hardware)[:2] for two in self._changed(one, is_free=False))
        )
        if self.found.search.margin is not None and self.found.search.margin > 1:  # a smaller margin holds narrowly
            yield start, self._search(start.loop, least_margin=_LEAST_MARGIN)

    def _changed(self, start: _Start, *, is_free: bool) -> list[_Start]:
        """Return loops with one more change."""
        candidates = self.found.loops if start.loop is self.task.loop else self._candidates(start.loop)
        return [
            _Start(c.loop, (*start.words, _as_step(c.sentence)), c.name, start)
            for c in candidates
            if c.is_free is is_free
        ]

    def _candidates(self, loop: ClosedLoop) -> list[ChangedLoop]:
        problem = self.found.search.problem
        changes, most = problem.changes_of_level(self.passed[0]), self.task.largest_sensor_rate
        return candidates_of(loop, *changes, most=most, gain=self.verdict.gain)

    def _promising(self, starts: list[_Start]) -> Iterator[tuple[_Start, GainSearch]]:
        """Yield thorough searches on those loops whose quick search nearly meets every requirement."""
        for start in self._ranked(starts)[:2]:
            if self._shortfall(start) <= _NEAR:
                yield start, self._search(start.loop)

    def _ranked(self, starts: list[_Start]) -> list[_Start]:
        """Return loops by the smallest shortfall of any gain."""
        return sorted(starts, key=self._shortfall)

    def _shortfall(self, start: _Start) -> float:
        """Return the smallest shortfall of any gain on a loop, from a few runs."""
        search = self.quick.get(id(start.loop))
        if search is None:
            note_work(f"trying: {', '.join(start.words)}")
            search = self.quick[id(start.loop)] = self._search(start.loop, _QUICK, _QUICK_RUNS)
        return min(map(search.worst, search.tried.values()), default=math.inf)

    def _search(
        self, loop: ClosedLoop, effort: Effort = RUNS, most: int | None = None, least_margin: float = USUAL_MARGIN
    ) -> GainSearch:
        """Search for the best gain on a changed loop, near the gain that is best or nearest on the loop."""
        base = self.found.search
        limit = None
        if base.margin is not None:
            limit = limit_of(loop, self.task.sensor, self.passed)
        asked = self.verdict.design.problem.task  # the bounds of self.task have the required margin on its own loop
        task = self.task if limit is None else self.task.replace(bounds=asked.bounds)
        axis, margin = stable_axis(task, limit, least_margin, asked.stability_margin)
        center = base.best or base.nearest() or self.verdict.gain or 0.0
        low, high = sorted((center / _AROUND, center * _AROUND))
        axis = GainAxis(low=max(axis.low, min(low, axis.high)), high=min(axis.high, max(high, axis.low)))
        runs = base.runs if most is None else min(most, base.runs)
        fields: dict[str, Any] = {"loop": loop, "axis": axis, "margin": margin, "runs": runs, "tried": {}}
        search = replace(base, **fields, has_room=True, strictness=1.0)
        search.run([self.verdict.gain] if self.verdict.gain is not None else [], effort)
        return search if most is not None or search.best is not None else search.relaxed(effort)

    def _with_best_gain(self, search: GainSearch) -> _Checked | None:
        """Return the best gain of a search that holds in the user's runs and in fresh runs.

        If a gain does not hold, the next one has more reserve.
        """
        for number in range(_TRIES):
            gain = search.best
            if gain is None:
                if not search.has_room:
                    return None
                search = search.relaxed()
                gain = search.best
                if gain is None:
                    return None
            checked = self._check(self.task.replace(gain=gain, loop=search.loop))
            if checked.shortfall <= 1 and checked.verdict.status.is_passed:
                return checked
            if math.isnan(checked.shortfall) or (checked.shortfall <= 1 and _misses_no_limit(checked.verdict)):
                return None  # more reserve does not help against other reasons
            search = search.stricter(_stricter(checked.shortfalls, number))
        return None

    def _without_needless(self, checked: _Checked, start: _Start) -> tuple[_Checked, tuple[str, ...]]:
        """Return a checked advice without the changes of the loop that its gain does not need, and the other changes.

        The gain is checked with fewer changes, first with none. It must get the same status, also in fresh runs, and
        have the required gain margin.
        """
        for fewer in self._with_fewer_changes(start):
            if not fewer.words and checked.task.gain == self.verdict.gain:
                continue  # this is the verified gain on its loop
            note_work(f"checking the advised gain with fewer changes: {', '.join(fewer.words) or 'only the gain'}")
            again = self._check(checked.task.replace(loop=fewer.loop))
            same = again.verdict.status.place <= checked.verdict.status.place
            if again.shortfall <= 1 and same and not misses_required_margin(again.verdict):
                return again, fewer.words
        return checked, start.words

    def _with_fewer_changes(self, start: _Start) -> list[_Start]:
        """Return loops with some of the changes of a loop, those with the fewest changes first."""
        levels = [[start]]
        while levels[-1]:
            levels.append(_each_once(fewer for one in levels[-1] for fewer in self._without_one(one)))
        return [one for level in reversed(levels[1:]) for one in level]

    def _without_one(self, start: _Start) -> Iterator[_Start]:
        """Yield the loops that lack one of the changes of a loop."""
        if start.before is None:
            return
        yield start.before
        for fewer in self._without_one(start.before):
            changed = (one for is_free in (True, False) for one in self._changed(fewer, is_free=is_free))
            yield from (one for one in changed if one.name == start.name)

    def _check(self, task: Task) -> _Checked:
        """Follow an advice: return the user's verdict, and the shortfall in fresh runs."""
        try:
            verdict = self.judge(task)
        except InvalidInputError:  # for example, contact is predicted only after the horizon of the loop
            return _Checked(task, self.verdict, np.array([math.nan]), 0)
        ratios = [0.0 if c.is_met else (c.value or math.inf) / c.limit for c in verdict.limits]
        shortfalls = np.array([0.0] * FIRST_LIMIT + ratios)
        shortfalls[shortfalls <= 1] = 0.0
        if verdict.status is VerdictStatus.DOES_NOT_HOLD:
            return _Checked(task, verdict, shortfalls, 0)
        count = fresh_runs(task)
        fresh = fresh_outcomes(task, count)
        shortfalls = np.maximum(shortfalls, fresh.shortfalls(count, task.verify.confidence))
        runs = runs_that_show(fresh, task.verify.confidence)
        if shortfalls.max() <= 1 and lacks_only_runs(verdict) and runs > task.verify.runs:
            more = task.replace(verify=replace(task.verify, runs=runs))
            with_more = self.judge(more)
            if with_more.status is VerdictStatus.HOLDS:
                return _Checked(more, with_more, shortfalls, count)
        return _Checked(task, verdict, shortfalls, count)

    def _change(self, checked: _Checked, words: tuple[str, ...]) -> Advice:
        """Describe a change with the verdict that results from it."""
        task, number = checked.task, self.task.law.number
        steps, gain = list(words), float(checked.task.gain or 0.0)
        old = self.verdict.gain
        if old is None or not math.isclose(gain, old, rel_tol=1e-6):
            margin = None if checked.verdict.stability is None else checked.verdict.stability.margin
            steps.insert(0, _as_step(redesign(number, old or 0.0, gain, margin)))
        elif self.task.gain is None and words:  # otherwise another gain would be designed for the changed loop
            steps.append(f"keep {number.equals(gain)}")
        if task.verify.runs != self.task.verify.runs:
            steps.append(f"simulate {task.verify.runs} runs")
        return self._advice("change", f"{_joined(steps)}. {_outcome(checked)}", checked)

    def _advice(self, kind: str, sentence: str, checked: _Checked) -> Advice:
        return Advice(
            kind=kind,
            sentence=sentence,
            settings=settings_between(self.task, checked.task),
            status=checked.verdict.status,
            fresh_runs=checked.fresh,
        )

    def _larger_limit(self) -> Advice | None:
        """Return the smallest increase of a limit with which a gain holds on the unchanged loop."""
        note_work("searching for the limits that a gain can meet")
        limits = limits_of(self.task.constraints)
        base = replace(self.found.search, whole=True, has_room=True, strictness=1.0, tried={})
        if not limits or not base.axis.low < base.axis.high:
            return None
        places = [i for i, limit in enumerate(limits) if limit.constraint.name != "gain"]
        unmitigated = uninformative_limits(self.task, base.problem)
        options = [option for i in places if (option := nearest_limits(base, [i])) is not None]
        if not options and len(places) > 1 and (together := nearest_limits(base, places)) is not None:
            options = [together]
        for gain, increase in sorted(options, key=lambda option: max(option[1].values()))[:2]:
            factor = 1.0
            for _ in range(_TRIES):
                larger = {i: rounded_up(limits[i].constraint.limit * r * factor, 3) for i, r in increase.items()}
                if any(value >= unmitigated[i] for i, value in larger.items()):
                    break  # a limit that is met without mitigation, too, says nothing
                constraints = tuple(with_limit(c, larger.get(i)) for i, c in enumerate(self.task.constraints))
                checked = self._check(self.task.replace(gain=base.printed(gain), constraints=constraints))
                if checked.shortfall <= 1 and checked.verdict.status.is_passed:
                    return self._limit_advice(checked, limits, larger)
                if math.isnan(checked.shortfall):
                    break
                factor *= float(_stricter(checked.shortfalls).max())
        return None

    def _limit_advice(self, checked: _Checked, limits: tuple[Required, ...], larger: dict[int, float]) -> Advice:
        number, texts, kept = self.task.law.number, [], []
        for i, value in larger.items():
            name, unit = words_for(limits[i].constraint.name), number.entry(limits[i].constraint.quantity).unit
            old = format_quantity(limits[i].constraint.limit, unit)
            texts.append(f"{format_quantity(value, unit)} instead of {old} for the {name}")
            kept.append(old)
        runs = f", and simulate {checked.task.verify.runs} runs" if checked.task.verify != self.task.verify else ""
        text = (
            f"allow {' and '.join(texts)}, with {number.equals(float(checked.task.gain or 0.0))}{runs}: no simulated "
            f"change of gain, controller, sensor and drive keeps {' and '.join(kept)}"
        )
        softer = softer_padding(checked.task, limits, larger)
        return self._advice("limit", f"{text}. {_outcome(checked)}{softer}{self._missed()}", checked)

    def _none(self) -> Advice:
        """Say that no simulated change holds."""
        tried = "other gains, and one or two changes of controller, sensor and drive with the best gain for them"
        text = f"none of the simulated changes holds ({tried}). Change the robot, the sensor or the requirements"
        return Advice(kind="none", sentence=f"{text}{self._missed()}")

    def _missed(self) -> str:
        """Return a sentence on the uncertain input that distinguishes the runs that miss a limit; empty if none does.

        The runs are those of the best or nearest gain on the unchanged loop.
        """
        if self.found.best is None:
            return ""
        (gain, result), draws = self.found.best, draw_encounters(self.task)
        problem = LoopProblem(draws=draws, predicted=np.isfinite(draws.predicted(gain)[0]), unmitigated=None)
        outcomes = problem.appraised(result, self.task.loop, gain)
        held = [r.held for r in outcomes.requirements[1:] if not r.is_met]
        text = missed_in_words(draws, ~np.all(held, axis=0)) if held else ""
        return f". With {self.task.law.number.equals(gain)}, {text}" if text else ""


def _stricter(shortfalls: FloatArray, number: int = 0) -> FloatArray:
    """Return the factors on the reserves of a further try, for those requirements that fell short.

    With each try, the reserve grows faster, because a slightly other gain fails in the same fresh runs.
    """
    factors = np.minimum(np.maximum(shortfalls, _STRICTER) ** (1 + number), _STRICTEST)
    return np.where(shortfalls > 1, factors, 1.0)


def _is_noise_a_guess(task: Task) -> bool:
    """Return True if the noise of the loop comes from a calibration that read each distance once."""
    report, chain = task.calibration, task.loop.chain
    if (
        report is None
        or report.best is None
        or "PT102" not in {split_code(text)[0] for text in (*report.reasons, *report.notes)}
    ):
        return False
    fitted = chain_of_fit(report.best, rate=chain.rate)
    return bool(chain.noise == fitted.noise and chain.relative_noise == fitted.relative_noise)


def _misses_no_limit(verdict: Verdict) -> bool:
    return all(check.is_met for check in verdict.limits)


def _outcome(checked: _Checked) -> str:
    """Return a clause with the verdict that results from an advice."""
    v = checked.verdict
    if v.status is VerdictStatus.HOLDS:
        return f"Then the gain holds, also in {checked.fresh} fresh runs"
    return f"Then the gain holds narrowly: {_first_sentence(v.reasons[0])}"


def _first_sentence(text: str) -> str:
    return text.partition(". ")[0].removesuffix(".")


def _as_step(sentence: str) -> str:
    """Return the first sentence of a recommendation as a clause."""
    text = _first_sentence(sentence)
    return f"{text[0].lower()}{text[1:]}"


def _joined(steps: list[str]) -> str:
    return steps[0] if len(steps) == 1 else f"{', '.join(steps[:-1])} and {steps[-1]}"


def _each_once(starts: Iterable[_Start]) -> list[_Start]:
    """Leave out the second of two loops with the same changes in another order."""
    seen: dict[frozenset[str], _Start] = {}
    for start in starts:
        seen.setdefault(frozenset(start.words), start)
    return list(seen.values())
