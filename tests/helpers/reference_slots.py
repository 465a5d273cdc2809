"""Arguments of the functions that make references and paths, for the fuzzer of the API."""

from __future__ import annotations

from hypothesis import strategies as st

from edge_values import Slot, count, number, numbers, signal

RANGE = {"low": number(0.0, near=1e-5), "high": number(50e-6)}
TIMES = {"duration": number(4.0), "ramp": number(0.5)}
REFERENCES: dict[str, dict[str, Slot]] = {
    "pt.sine": {"frequency": number(1.0), "phase": number(0.0), **RANGE, **TIMES},
    "pt.triangle": {"frequency": number(1.0), "rounding": number(0.1), **RANGE, **TIMES},
    "pt.chirp": {"start_frequency": number(0.1), "stop_frequency": number(5.0), **RANGE, **TIMES},
    "pt.staircase": {
        "dwell": number(0.5), "steps": count(5), "rise": number(0.1),
        "duration": number(None, near=4.0), **RANGE,
    },
    "pt.multisine": {
        "frequencies": numbers(0.5, 1.0, 1.5), "seed": count(None), **RANGE, **TIMES,
    },
}  # fmt: skip
OTHER_FORMS: dict[str, dict[str, Slot]] = {
    "pt.staircase": {
        "dwell": number(0.5), "levels": numbers(0.0, 3e-5, 1e-5), "rise": number(None, near=0.1),
    },
    "pt.multisine": {
        "frequencies": numbers(0.5, 1.0, 1.5), "amplitudes": numbers(1e-6, 2e-6, 1e-6),
        "offset": number(1e-5), **TIMES,
    },
    "pt.Reference.from_samples": {
        "x": signal(60, 1e-5), "dt": number(0.02), "period": number(None, near=1.0),
        "duration": number(None, near=1.0), "ramp": number(0.0, near=1.0),
    },
}  # fmt: skip
CENTRE = numbers(5e-5, 5e-5, most=3)
ORIGIN = Slot((0.0, 0.0), st.one_of(st.none(), numbers(0.0, 0.0, most=3).other))
PATHS: dict[str, dict[str, Slot]] = {
    "pt.circle": {"frequency": number(0.1), "radius": number(1e-5), "phase": number(0.0)},
    "pt.lissajous": {
        "frequencies": numbers(0.2, 0.3, most=3), "sizes": numbers(2e-5, 2e-5, most=3),
        "phase": number(1.0),
    },
    "pt.raster": {
        "line_rate": number(1.0), "sizes": numbers(2e-5, 2e-5, most=3), "lines": count(9),
        "flyback": number(0.25),
    },
    "pt.spiral": {"frequency": number(0.5), "radius": number(2e-5), "pitch": number(2e-6)},
}  # fmt: skip
for _name, _slots in PATHS.items():
    _slots |= {"centre": CENTRE, "origin": ORIGIN, "ramp": number(None, near=0.5)}
    if _name != "pt.spiral":
        _slots["duration"] = number(None, near=10.0)
