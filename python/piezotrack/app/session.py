"""Session of one window: a worker that does what the window sends, and sends back the page."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .._support.messages import quoted
from ..errors import ParameterError, PiezotrackError
from .desk import Desk, Download, own_fault
from .parts import Plotter, action, buttons, message, messages
from .pictures import picture
from .state import STEPS, State
from .steps import PAGES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .device import DeviceProcess
    from .parts import Part

    Send = Callable[[dict[str, Any], bytes | None], None]

__all__ = ["Session"]

# States that `undo` goes back to.
REMEMBERED = 100
# Time after which the page of a computation in the background is shown [s]; what it reports in
# between is shown at once.
PACE = 0.1


class Session:
    """A window's desk, and the thread that works at it.

    Of messages that set the same values the latest one wins: those that wait are dropped.

    Parameters
    ----------
    send : callable
        Sends a message, and a file with it, to the window; from any thread.
    device : DeviceProcess, optional
        The device that was named on the command line.
    """

    def __init__(self, send: Send, device: DeviceProcess | None = None) -> None:
        self.send = send
        self.desk = Desk(self.refresh, device)
        self._past: list[State] = []
        self._future: list[State] = []
        self._last_live: object = None
        self._waiting: OrderedDict[object, Mapping[str, Any]] = OrderedDict()
        self._condition = threading.Condition()
        self._closed = False
        self._sent: dict[str, Part] = {}
        self._worker = threading.Thread(target=self._work, daemon=True, name="session")
        self._worker.start()

    def take(self, given: Mapping[str, Any]) -> None:
        """Queue a message of the window; it takes the place of one of the same kind."""
        key: object = object()
        if given.get("do") in ("set", "zoom", "size", "refresh"):
            names = sorted(given["values"]) if isinstance(given.get("values"), dict) else ()
            key = (given["do"], str(given.get("step")), str(given.get("chart")), *names)
        with self._condition:
            self._waiting.pop(key, None)
            self._waiting[key] = given
            self._condition.notify()

    def refresh(self, do: str = "refresh") -> None:
        """Show the page again, or do an action of it, soon."""
        timer = threading.Timer(PACE, self.take, [{"do": do}])
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """End the worker and what runs in the background."""
        with self._condition:
            self._closed = True
            self._condition.notify()
        self.desk.stop()
        self._worker.join(timeout=30.0)
        self.desk.close()

    def _work(self) -> None:
        while True:
            with self._condition:
                while not self._waiting and not self._closed:
                    self._condition.wait()
                if self._closed:
                    return
                _, given = self._waiting.popitem(last=False)
            self._answer(given)

    def _answer(self, given: Mapping[str, Any]) -> None:
        """Do what a message says, and send the page."""
        self.desk.live = bool(given.get("live"))
        error: Part | None = None
        download = None
        try:
            download = self._do(given)
        except PiezotrackError as problem:
            named = getattr(problem, "argument", None)
            error = {"text": str(problem), "control": named}
        except Exception as problem:
            error = {"text": own_fault(problem), "control": None}
        answer = self._page()
        if download is not None:
            answer["download"] = download.name
        answer |= {"seq": given.get("seq"), "error": error}
        self.send(answer, None if download is None else download.content)

    def _do(self, given: Mapping[str, Any]) -> Download | None:
        desk, do = self.desk, given.get("do")
        if do in ("refresh", "whole", "size"):
            if do != "refresh":
                self._sent = {} if do == "whole" else self._sent
                width = given.get("width", desk.plotter.width)
                if isinstance(width, int):
                    desk.plotter = Plotter(width, desk.plotter.zoom)
            return None
        if do == "set":
            self._set(given)
        elif do == "go":
            self._change(replace(desk.state, **_step(given)), ("go",))
        elif do in ("undo", "redo"):
            self._back(do)
        elif do == "zoom":
            self._zoom(given.get("chart"), given.get("box"))
        elif do == "link":
            self._change(State.of_link(str(given.get("text"))), None)
        elif do == "stop":
            desk.stop()
        elif do == "open":
            self._open(given)
        elif do == "picture":
            return picture(desk, PAGES[desk.state.step].page, str(given.get("chart")))
        else:
            step, _, name = str(do).partition(".")
            function = PAGES[step].actions.get(name) if step in PAGES else None
            if function is None:
                raise ParameterError("do", quoted(do), "an action of the page")
            before = desk.state
            download = function(desk, given.get("values") or {})
            after, desk.state = desk.state, before
            self._change(after, None)
            return download
        return None

    def _set(self, given: Mapping[str, Any]) -> None:
        step, values = str(given.get("step")), given.get("values")
        if not isinstance(values, dict):
            raise ParameterError("values", quoted(values), "settings by name")
        live = (step, *sorted(values)) if given.get("live") else None
        self._change(self.desk.state.changed(step, values), live)

    def _change(self, state: State, live: object) -> None:
        """Take a new state; those of one drag of a slider are undone as one."""
        if state == self.desk.state:
            return
        if live is None or live != self._last_live:
            self._past = [*self._past[-REMEMBERED:], self.desk.state]
            self._future = []
        self._last_live = live
        self.desk.state = state

    def _back(self, do: str) -> None:
        source, target = (self._past, self._future) if do == "undo" else (self._future, self._past)
        if source:
            target.append(self.desk.state)
            self.desk.state = source.pop()
        self._last_live = None

    def _zoom(self, chart: object, box: object) -> None:
        plotter = self.desk.plotter
        zoom = {key: value for key, value in plotter.zoom.items() if key != chart}
        if isinstance(box, list) and len(box) == 4 and all(type(v) in (int, float) for v in box):
            zoom[str(chart)] = (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
        self.desk.plotter = Plotter(plotter.width, zoom)

    def _open(self, given: Mapping[str, Any]) -> None:
        """Take a file that was dropped."""
        purpose, name, content = given["purpose"], str(given["name"]), given["content"]
        if purpose == "state":
            self._change(State.read(content), None)
            return
        if purpose not in ("log", "test", "motion"):
            raise ParameterError("purpose", quoted(purpose), "log, test, motion or state")
        asked_again = not self.desk.is_open(purpose)
        kept = self.desk.keep(purpose, name, content)
        step, values = {
            "log": ("log", {"source": kept}),
            "test": ("model", {"test": kept}),
            "motion": ("motion", {"kind": "file", "file": kept}),
        }[purpose]
        state = self.desk.state
        if purpose == "log" and not (asked_again and kept == state.log.source):
            # Another record: nothing of the last one holds. A state that was opened holds for it.
            fresh = State()
            state = replace(state, log=fresh.log, model=fresh.model, motion=fresh.motion)
            state = replace(state, loop=fresh.loop)
            self.desk.forget("test")
            self.desk.plotter = Plotter(self.desk.plotter.width, {})
        self._change(state.changed(step, values), None)

    def _page(self) -> dict[str, Any]:
        """Return the page: the parts that differ from what the window has."""
        desk = self.desk
        step = desk.state.step
        parts: list[Part] = []
        try:
            for part in PAGES[step].page(desk):
                parts.append(part)
        except PiezotrackError as problem:
            parts.append(messages("fault", message("red", str(problem))))
            if step != "log" and _light(desk, "log")[0] == "red":
                parts.append(buttons("back", action("Go to Log", "go", to="log", primary=True)))
        except Exception as problem:
            parts.append(messages("fault", message("red", own_fault(problem))))
        rail: list[dict[str, str]] = []
        for name in STEPS:
            light, sentence = _light(desk, name)
            title = PAGES[name].title
            if any(sentence == one["text"] for one in rail if light == one["light"] == "red"):
                light, sentence = "grey", "waits for a step above"
            rail.append({"step": name, "title": title, "light": light, "text": sentence})
            if rail[-2:-1] and rail[-2]["step"] == step and rail[-2]["light"] in ("green", "amber"):
                parts.append(
                    buttons("onward", action(f"Next: {title}", "go", to=name, primary=True))
                )
        named = {f"{step}.{part['id']}": part for part in parts}
        changed = {key: part for key, part in named.items() if self._sent.get(key) != part}
        self._sent = named
        return {
            "step": step,
            "rail": rail,
            "order": list(named),
            "changed": changed,
            "link": desk.state.link(),
            "undo": bool(self._past),
            "redo": bool(self._future),
            "running": ", ".join(desk.running),
            "stopping": ", ".join(desk.stopping),
            "device": desk.device is not None,
        }


def _light(desk: Desk, name: str) -> tuple[str, str]:
    try:
        return PAGES[name].light(desk)
    except PiezotrackError as problem:
        return "red", str(problem)
    except Exception as problem:
        return "red", own_fault(problem)


def _step(given: Mapping[str, Any]) -> dict[str, Any]:
    step = given.get("to")
    if step not in STEPS:
        raise ParameterError("to", quoted(step), f"one of {', '.join(STEPS)}")
    return {"step": step}
