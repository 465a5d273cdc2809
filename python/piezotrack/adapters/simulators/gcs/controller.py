"""A virtual controller: the commands of one axis, and what it answers."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from ...gcs.protocol import (
    GENERATOR,
    MOVING,
    POSITION,
    READY,
    RECORD_POINTS,
    RECORD_RATE,
    RECORD_TABLES,
    SERVO_CYCLE,
    STOP,
    VOLTAGE,
    WAVE_POINTS,
    array_answer,
)
from .arguments import (
    AXIS,
    Refusal,
    asked_for,
    axes_of,
    channel_of,
    fixed,
    for_axes,
    for_channels,
    none_of,
    number_of,
    numbered,
    pairs_of,
    parameter_of,
    plain,
    range_of,
    whole_of,
)
from .axis import CLOCK, VirtualAxis
from .help_text import (
    NOW,
    ON_COMMAND,
    ON_GENERATOR,
    ON_MOTION,
    OPTIONS,
    TRIGGERS,
    commands,
    parameters,
    recorder,
)
from .waves import WaveTables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ....stages.virtual import VirtualStage

    Query = Callable[["VirtualController", Sequence[str]], list[str]]
    Action = Callable[["VirtualController", Sequence[str]], None]

__all__ = ["VirtualController"]

NAME = "(c) piezotrack, VIRTUAL-GCS, 0, 1.0.0"
# Sizes of the memories, and the slowest rate of a table [servo cycles].
WAVES, POINTS, TABLES, SLOWEST = 8, 262_144, 4, 10_000
MOST_CYCLES = 2**31 - 1
# Bits of the mode of WGO: start now; start from where the stage is.
START, FROM_HERE = 0x1, 0x100


class VirtualController:
    """A controller with a virtual stage on its axis 1, as the manual of an E-727 has it.

    Parameters
    ----------
    stage : VirtualStage
        The stage.
    limits : (float, float)
        Lowest and highest voltage [V].
    speed : float, optional
        How much faster than real time it goes.
    clock : callable, optional
        The computer's clock [s].
    """

    def __init__(
        self,
        stage: VirtualStage,
        limits: tuple[float, float],
        *,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lock = threading.RLock()
        self._axis = VirtualAxis(stage, limits, speed, clock)
        self._reset()

    def _reset(self) -> None:
        """Set what a command can set back to the start."""
        self._waves = WaveTables(WAVES, POINTS)
        self._selected, self._cycles, self._offset = 0, 0, 0.0
        self._rate, self._interpolated, self._mode = 1, False, 0
        self._record_rate, self._trigger = 1, ON_GENERATOR
        self._tables = {1: (AXIS, POSITION), 2: (AXIS, VOLTAGE)} | dict.fromkeys(
            range(3, TABLES + 1), (AXIS, 0)
        )

    def ask(self, line: str) -> list[str] | None:
        """Obey a command, or answer a query.

        Parameters
        ----------
        line : str
            Without its end.

        Returns
        -------
        list of str or None
            Lines of the answer; None where there is none.

        Raises
        ------
        Refusal
            With the code for ERR?.
        """
        # One of the bytes is what else separates words.
        words = [line] if line == GENERATOR else line.split()
        if not words:
            return None
        name, rest = words[0].upper(), words[1:]
        with self._lock:
            self._axis.catch_up()
            if (query := QUERIES.get(name)) is not None:
                return query(self, rest)
            action = ACTIONS.get(name)
            if action is None:
                raise Refusal(2)
            action(self, rest)
            if name not in ("DRT", "DRC", "RTR") and self._trigger == ON_COMMAND:
                self._trigger = ON_GENERATOR
                self._record()
        return None

    @property
    def generating(self) -> bool:
        """Whether the wave generator runs."""
        with self._lock:
            self._axis.catch_up()
            return self._axis.generator is not None

    def left(self, abandoned: str) -> None:
        """End a wave whose client has gone, as of `GcsServer`."""
        with self._lock:
            if self.generating and abandoned != "runs":
                self._mode = 0
                self._axis.stop() if abandoned == "stops" else self._axis.lead_to_rest()

    # Queries of the controller.

    def _commands(self, words: Sequence[str]) -> list[str]:
        none_of(words)
        names = [name for name in (*ACTIONS, *QUERIES) if name.isprintable()]
        return commands([*names, "ERR?", "#5", "#7", "#9", "#24"])

    def _recorder_help(self, words: Sequence[str]) -> list[str]:
        none_of(words)
        return recorder(TABLES, POINTS // TABLES)

    def _parameters(self) -> dict[int, tuple[str, str, str]]:
        """Type, value and description of each parameter."""
        return {
            SERVO_CYCLE: ("FLOAT", f"{1.0 / CLOCK:.8g}", "Servo Update Time"),
            WAVE_POINTS: ("INT", str(POINTS), "Maximum Number Of Wave Points"),
            RECORD_RATE: ("INT", str(self._record_rate), "Data Recorder Table Rate"),
            RECORD_POINTS: ("INT", str(POINTS), "Data Recorder Max Points"),
            RECORD_TABLES: ("INT", str(TABLES), "Data Recorder Chan Number"),
        }

    def _parameter_help(self, words: Sequence[str]) -> list[str]:
        none_of(words)
        return parameters(self._parameters())

    def _parameter(self, words: Sequence[str]) -> list[str]:
        known = self._parameters()
        pairs = (
            [(word[0], word[1]) for word in pairs_of(words)]
            if words
            else [(AXIS, f"0x{number:08X}") for number in known]
        )
        answers = []
        for item, name in pairs:
            channel_of(item)
            number = parameter_of(name)
            if number not in known:
                raise Refusal(54)
            answers.append(f"{item} {name}={known[number][1]}")
        return answers

    def _set_parameter(self, words: Sequence[str]) -> None:
        for item, name, value in pairs_of(words, 3):
            channel_of(item)
            number = parameter_of(name)
            if number not in self._parameters():
                raise Refusal(54)
            if number != RECORD_RATE:
                raise Refusal(64)
            self._set_record_rate([value])

    # Motion.

    def _servo(self, words: Sequence[str]) -> None:
        states = [(axis, whole_of(value)) for axis, value in pairs_of(words)]
        axes_of(axis for axis, _ in states)
        if any(state not in (0, 1) for _, state in states):
            raise Refusal(17)
        self._still()
        for _, state in states:
            self._axis.set_servo(state == 1)

    def _move(self, words: Sequence[str], relative: bool = False) -> None:
        pairs = [(axis, number_of(value)) for axis, value in pairs_of(words)]
        axes_of(axis for axis, _ in pairs)
        if not self._axis.servo:
            raise Refusal(5)
        self._still()
        for _, value in pairs:
            target = value + (self._axis.target if relative else 0.0)
            low, high = self._axis.travel
            if not low <= target <= high:
                raise Refusal(7)
            self._axis.set_target(target)
        self._moved()

    def _set_voltage(self, words: Sequence[str], relative: bool = False) -> None:
        pairs = [(axis, number_of(value)) for axis, value in pairs_of(words)]
        axes_of(axis for axis, _ in pairs)
        if self._axis.servo:
            raise Refusal(79)
        self._still()
        for _, value in pairs:
            volts = value + (self._axis.control if relative else 0.0)
            self._within(volts, volts)
            self._axis.set_control(volts)
        self._moved()

    def _moved(self) -> None:
        if self._trigger == ON_MOTION:
            self._record()

    def _stop(self, words: Sequence[str]) -> None:
        axes_of(words)
        self._axis.stop()
        raise Refusal(10)

    def _restart(self, words: Sequence[str]) -> None:
        none_of(words)
        self._axis.stop()
        self._axis.set_servo(False)
        self._reset()

    def _still(self) -> None:
        if self._axis.generator is not None:
            raise Refusal(73)

    def _within(self, lowest: float, highest: float) -> None:
        low, high = self._axis.limits
        if lowest < low or highest > high:
            raise Refusal(66)

    # The wave generator.

    def _wave(self, words: Sequence[str]) -> None:
        if len(words) < 3:
            raise Refusal(26)
        table = numbered(words[0], WAVES)
        if table == self._selected:
            self._still()
        self._waves.define(table, words[1].upper(), words[2:])

    def _clear_waves(self, words: Sequence[str]) -> None:
        tables = [numbered(word, WAVES) for word in words] or list(range(1, WAVES + 1))
        if self._selected in tables:
            self._still()
        for table in tables:
            self._waves.clear(table)

    def _wave_sizes(self, words: Sequence[str]) -> list[str]:
        if words:
            tables = [numbered(word, WAVES) for word in words[::2]]
            if any(whole_of(word) != 1 for word in words[1::2]):
                raise Refusal(54)
        else:
            tables = list(range(1, WAVES + 1))
        return [f"{table} 1={self._waves[table].size}" for table in tables]

    def _wave_data(self, words: Sequence[str]) -> list[str]:
        first, count, tables = range_of(words, WAVES)
        chosen = tables or [k for k in range(1, WAVES + 1) if self._waves[k].size]
        if not chosen:
            raise Refusal(77)
        sizes = {self._waves[table].size for table in chosen}
        most = min(sizes)
        if count is None:
            count = most - first
            if len(sizes) > 1:
                raise Refusal(70)
        if count < 1 or first + count > most:
            raise Refusal(17)
        columns = [self._waves[table][first : first + count] for table in chosen]
        names = [f"Wave Table {table}" for table in chosen]
        return array_answer(names, columns, self._rate / CLOCK)

    def _select(self, words: Sequence[str]) -> None:
        self._still()
        for generator, table in pairs_of(words):
            channel_of(generator)
            self._selected = 0 if whole_of(table) == 0 else numbered(table, WAVES)

    def _set_cycles(self, words: Sequence[str]) -> None:
        for generator, cycles in pairs_of(words):
            channel_of(generator)
            self._cycles = numbered(cycles, MOST_CYCLES) if whole_of(cycles) else 0

    def _set_rate(self, words: Sequence[str]) -> None:
        self._still()
        for generator, rate, interpolation in pairs_of(words, 3):
            # 0 means all of them.
            if whole_of(generator) != 0:
                channel_of(generator)
            if whole_of(interpolation) not in (0, 1):
                raise Refusal(17)
            self._rate = numbered(rate, SLOWEST)
            self._interpolated = whole_of(interpolation) == 1

    def _set_offset(self, words: Sequence[str]) -> None:
        for generator, offset in pairs_of(words):
            channel_of(generator)
            self._offset = number_of(offset)

    def _generate(self, words: Sequence[str]) -> None:
        for generator, mode in pairs_of(words):
            channel_of(generator)
            wanted = parameter_of(mode)
            if wanted & ~(START | FROM_HERE):
                raise Refusal(17)
            if not wanted & START:
                self._axis.generator, self._mode = None, 0
                continue
            self._still()
            self._start(from_here=bool(wanted & FROM_HERE))
            self._mode = wanted

    def _start(self, *, from_here: bool) -> None:
        table = self._waves[self._selected] if self._selected else None
        if table is None or not table.size:
            raise Refusal(75)
        here = self._axis.target if self._axis.servo else self._axis.control
        offset = here - float(table[0]) if from_here else self._offset
        lowest, highest = float(table.min()) + offset, float(table.max()) + offset
        if not self._axis.servo:
            self._within(lowest, highest)
        elif lowest < self._axis.travel[0] or highest > self._axis.travel[1]:
            raise Refusal(7)
        start = self._axis.start(
            table,
            rate=self._rate,
            repetitions=self._cycles,
            interpolated=self._interpolated,
            offset=offset,
        )
        self._record(start)

    def _running(self, words: Sequence[str]) -> list[str]:
        none_of(words)
        return [f"0x{int(self._axis.generator is not None):x}"]

    # The data recorder.

    def _record(self, start: int | None = None) -> None:
        self._axis.record(self._record_rate, POINTS // TABLES, start)

    def _set_table(self, words: Sequence[str]) -> None:
        sources = {}
        for table, source, option in pairs_of(words, 3):
            if whole_of(option) not in OPTIONS:
                raise Refusal(58)
            if source != AXIS:
                raise Refusal(59)
            sources[numbered(table, TABLES, 57)] = (source, whole_of(option))
        self._tables.update(sources)

    def _set_trigger(self, words: Sequence[str]) -> None:
        for table, trigger, _ in pairs_of(words, 3):
            if whole_of(table) != 0:
                numbered(table, TABLES, 57)
            if whole_of(trigger) not in TRIGGERS:
                raise Refusal(17)
            self._trigger = whole_of(trigger)
            if self._trigger == NOW:
                self._trigger = ON_GENERATOR
                self._record()

    def _set_record_rate(self, words: Sequence[str]) -> None:
        if len(words) != 1:
            raise Refusal(24)
        self._record_rate = numbered(words[0], SLOWEST)

    def _again(self, words: Sequence[str]) -> None:
        none_of(words)
        if self._axis.generator is None:
            raise Refusal(89)
        self._record()

    def _recorded(self, words: Sequence[str]) -> list[str]:
        tables = asked_for(words, [str(k) for k in self._tables], 57)
        count = self._axis.recorder.count
        return [f"{one}={count if self._tables[int(one)][1] else 0}" for one in tables]

    def _data(self, words: Sequence[str]) -> list[str]:
        first, count, tables = range_of(words, TABLES, 57)
        chosen = tables or [k for k, (_, option) in self._tables.items() if option]
        if not chosen or any(not self._tables[table][1] for table in chosen):
            raise Refusal(78)
        recorder = self._axis.recorder
        if count is None:
            count = recorder.count - first
        if count < 1 or first + count > recorder.count:
            raise Refusal(77)
        names, columns = [], []
        for table in chosen:
            source, option = self._tables[table]
            names.append(f"{OPTIONS[option]} {source}")
            columns.append(recorder.column(option, first, count))
        return array_answer(names, columns, recorder.rate / CLOCK)


QUERIES: dict[str, Query] = {
    "*IDN?": lambda _, words: fixed(words, NAME),
    "IDN?": lambda _, words: fixed(words, NAME),
    "CSV?": lambda _, words: fixed(words, "2.0"),
    "VER?": lambda _, words: fixed(words, f"FW: {NAME}"),
    "SSN?": lambda _, words: fixed(words, "0"),
    "TNR?": lambda _, words: fixed(words, str(TABLES)),
    "TWG?": lambda _, words: fixed(words, "1"),
    "SAI?": lambda _, words: fixed([w for w in words if w.upper() != "ALL"], AXIS),
    "CST?": lambda _, words: for_axes(words, "VIRTUAL"),
    "PUN?": lambda _, words: for_axes(words, "UM"),
    "SVO?": lambda self, words: for_axes(words, str(int(self._axis.servo))),
    "MOV?": lambda self, words: for_axes(words, plain(self._axis.target)),
    "POS?": lambda self, words: for_axes(words, plain(self._axis.position)),
    "TSP?": lambda self, words: for_channels(words, plain(self._axis.position)),
    "ONT?": lambda self, words: for_axes(words, str(int(self._axis.on_target))),
    "SVA?": lambda self, words: for_axes(words, plain(self._axis.control)),
    "VOL?": lambda self, words: for_channels(words, plain(self._axis.voltage)),
    "OVF?": lambda self, words: for_axes(
        words, str(int(self._axis.servo and self._axis.voltage in self._axis.limits))
    ),
    "TMN?": lambda self, words: for_axes(words, plain(self._axis.travel[0])),
    "TMX?": lambda self, words: for_axes(words, plain(self._axis.travel[1])),
    "VMI?": lambda self, words: for_channels(words, plain(self._axis.limits[0])),
    "VMA?": lambda self, words: for_channels(words, plain(self._axis.limits[1])),
    "WSL?": lambda self, words: for_channels(words, str(self._selected)),
    "WGC?": lambda self, words: for_channels(words, str(self._cycles)),
    "WTR?": lambda self, words: for_channels(words, f"{self._rate} {int(self._interpolated)}"),
    "WOS?": lambda self, words: for_channels(words, plain(self._offset)),
    "WGO?": lambda self, words: for_channels(words, str(self._mode if self._axis.generator else 0)),
    "WAV?": VirtualController._wave_sizes,
    "GWD?": VirtualController._wave_data,
    "DRC?": lambda self, words: [
        f"{one}={' '.join(map(str, self._tables[int(one)]))}"
        for one in asked_for(words, [str(k) for k in self._tables], 57)
    ],
    "DRT?": lambda self, words: [
        f"{one}={self._trigger} 0" for one in asked_for(words, [str(k) for k in self._tables], 57)
    ],
    "RTR?": lambda self, words: fixed(words, str(self._record_rate)),
    "DRL?": VirtualController._recorded,
    "DRR?": VirtualController._data,
    "HDR?": VirtualController._recorder_help,
    "HLP?": VirtualController._commands,
    "HPA?": VirtualController._parameter_help,
    "SPA?": VirtualController._parameter,
    MOVING: lambda self, words: fixed(words, f"0x{int(self._axis.moving):x}"),
    READY: lambda _, words: fixed(words, chr(177)),
    GENERATOR: VirtualController._running,
}
ACTIONS: dict[str, Action] = {
    "SVO": VirtualController._servo,
    "MOV": VirtualController._move,
    "MVR": lambda self, words: self._move(words, relative=True),
    "SVA": VirtualController._set_voltage,
    "SVR": lambda self, words: self._set_voltage(words, relative=True),
    "WAV": VirtualController._wave,
    "WCL": VirtualController._clear_waves,
    "WSL": VirtualController._select,
    "WGC": VirtualController._set_cycles,
    "WTR": VirtualController._set_rate,
    "WOS": VirtualController._set_offset,
    "WGO": VirtualController._generate,
    "WGR": VirtualController._again,
    "TWC": lambda _, words: none_of(words),
    "DRC": VirtualController._set_table,
    "DRT": VirtualController._set_trigger,
    "RTR": VirtualController._set_record_rate,
    "SPA": VirtualController._set_parameter,
    "HLT": VirtualController._stop,
    "STP": VirtualController._stop,
    STOP: VirtualController._stop,
    "RBT": VirtualController._restart,
}
