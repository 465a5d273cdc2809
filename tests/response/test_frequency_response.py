"""Frequency response: value, uncertainty and refusals, against scipy, python-control and theory."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, freqz

import piezotrack as pt
from piezotrack.response.best_linear_approximation import approximate, spectra

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

RATE = 2000.0
GAIN, MODE, ZETA = 1e-6, 160.0, 0.02
# Dead zones that are never left: a stage without hysteresis.
LINEAR = pt.PrandtlIshlinskiiStage(linear=GAIN, thresholds=(1000.0,), weights=(1e-6,))
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(0.5, 1.5, 4.0), weights=(3e-7, 3e-7, 2e-7)
)
LINES = pt.RandomPhaseMultisine(band=(8.0, 800.0), low=28.0, high=32.0, settle=4)


def true_response(frequency: Array, rate: float = RATE, delay: int = 0) -> Any:
    """Compute the response of the mode behind a held input by scipy."""
    w = 2.0 * np.pi * MODE
    system = ([GAIN * w * w], [1.0, 2.0 * ZETA * w, w * w])
    numerator, denominator, _ = cont2discrete(system, 1.0 / rate, method="zoh")
    _, found = freqz(np.squeeze(numerator), denominator, worN=2.0 * np.pi * frequency / rate)
    return found * np.exp(-2j * np.pi * frequency * delay / rate)


def modal(noise: float = 0.0, **others: Any) -> pt.VirtualStage:
    return pt.VirtualStage.of(LINEAR, mode=(MODE, ZETA), noise=noise, **others)


def log_of(u: Array, y: Array, rate: float = RATE) -> pt.Dataset:
    return pt.Dataset(u=u, y=y, dt=1.0 / rate, hold="zoh")


def test_without_noise_it_is_that_of_the_sampled_mode() -> None:
    settled = replace(LINES, settle=12)
    found = pt.frequency_response(modal(), settled, rate=RATE)
    assert found.frequency[[0, -1]] == pytest.approx([8.0, 792.0])
    error = np.abs(found.value - true_response(found.frequency)) / found.magnitude
    assert error.max() < 1e-6
    # Nothing differs between periods but what is left of the transient.
    assert found.noise is not None
    assert np.sqrt(found.noise).max() < 1e-6 * found.magnitude.max()


def test_a_delay_is_in_the_phase() -> None:
    found = pt.frequency_response(modal(delay=2 / RATE), replace(LINES, settle=12), rate=RATE)
    assert found.value == pytest.approx(true_response(found.frequency, delay=2), rel=1e-5)


@pytest.mark.parametrize(("realisations", "periods"), [(6, 4), (2, 3), (1, 5), (5, 1)])
def test_the_band_holds_the_true_response(realisations: int, periods: int) -> None:
    random = np.random.default_rng(5)
    experiment = replace(LINES, realisations=realisations, periods=periods)
    lines = experiment.numbers(RATE)
    truth = true_response(lines * RATE / experiment.samples(RATE))
    inside = []
    for seed in range(200):
        signals = replace(experiment, seed=seed).signals(RATE)
        drive = np.repeat(signals[:, np.newaxis], periods, axis=1)
        spectrum = np.fft.rfft(drive, axis=-1)
        answer = np.zeros_like(spectrum)
        answer[..., lines] = truth * spectrum[..., lines]
        noise = 2e-7 * random.standard_normal(drive.shape)
        output = np.fft.irfft(answer, drive.shape[-1], axis=-1) + noise
        logs = [log_of(u.ravel(), y.ravel()) for u, y in zip(drive, output, strict=True)]
        if periods == 1:
            u, y = spectra(drive, lines), spectra(output, lines)
            found = approximate(y, u, u.mean(axis=1))
            half = 0.5 * found.degrees
            band = np.sqrt(found.variance * half * (0.05 ** (-1.0 / half) - 1.0))
            inside.append(np.abs(found.value - truth) <= band)
        else:
            response = pt.frequency_response(logs, period=experiment.samples(RATE) / RATE)
            inside.append(np.abs(response.value - truth) <= response.band())
    assert 0.93 <= np.mean(inside) <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize("noise", [5e-9, 100e-9])
def test_the_band_holds_on_a_stage_with_hysteresis(noise: float) -> None:
    # The truth is the best linear approximation, the mean over many phases.
    def measured(seed: int) -> pt.FrequencyResponse:
        stage = pt.VirtualStage.of(PLAYS, noise=noise, mode=(MODE, 0.1), seed=seed)
        return pt.frequency_response(stage, replace(LINES, seed=seed, settle=1), rate=RATE)

    truth = np.mean([measured(1000 + seed).value for seed in range(600)], axis=0)
    runs = [measured(seed) for seed in range(200)]
    inside = [np.abs(run.value - truth) <= run.band() for run in runs]
    assert 0.93 <= np.mean(inside) <= 0.97


def test_distortion_is_told_from_noise() -> None:
    # Of a cubic, driven by many lines: gain 1 + 3 c s^2, and a residue of variance 6 c^2 s^6
    # (Pintelon and Schoukens 2012, section 3.4, for Gaussian signals).
    c, sigma_noise, many = 0.02, 0.05, 200
    experiment = replace(
        LINES, band=(4.0, 996.0), low=-3.0, high=3.0, realisations=many, periods=2, lines="all"
    )
    signals = experiment.signals(RATE)
    size = signals.std()
    drive = np.repeat(signals[:, np.newaxis], 2, axis=1)
    noise = sigma_noise * np.random.default_rng(1).standard_normal(drive.shape)
    output = 1e-6 * (drive + c * drive**3 + noise)
    logs = [log_of(u.ravel(), y.ravel()) for u, y in zip(drive, output, strict=True)]
    found = pt.frequency_response(logs)
    assert 1e6 * np.mean(found.value.real) == pytest.approx(1.0 + 3.0 * c * size**2, rel=2e-3)
    assert found.distortion is not None
    assert found.noise is not None
    # Per line: the variance of a signal over as many bins as half the samples, over that of a line.
    count, lines = drive.shape[-1], found.frequency.size
    per_line = 1e12 * found.noise.mean() * many * 2.0
    assert per_line == pytest.approx(sigma_noise**2 * lines / size**2 * 2.0 / count, rel=0.1)
    # A third of the residue of a cubic falls beyond the lines, or folds back at half the rate.
    residue = 6.0 * c**2 * size**6 / size**2
    assert 1e12 * found.distortion.mean() == pytest.approx(residue, rel=0.35)


def test_even_distortion_falls_between_odd_lines() -> None:
    signals = replace(LINES, low=-3.0, high=3.0).signals(RATE)
    logs = [log_of(u, 1e-6 * (u + 0.1 * u * u)) for u in np.tile(signals, (1, 3))]
    odd = pt.frequency_response(logs)
    assert odd.value == pytest.approx(1e-6, rel=1e-9)
    every = replace(LINES, low=-3.0, high=3.0, lines="all").signals(RATE)
    logs = [log_of(u, 1e-6 * (u + 0.1 * u * u)) for u in np.tile(every, (1, 3))]
    disturbed = pt.frequency_response(logs)
    assert disturbed.distortion is not None
    assert np.sqrt(disturbed.distortion.mean()) > 0.03e-6


def test_drift_and_creep_do_not_leak_into_the_lines() -> None:
    signals = LINES.signals(RATE)
    total = np.tile(signals, (1, 5))
    t = np.arange(total.shape[1]) / RATE
    drift = 0.2e-6 * np.log1p(t / 0.5) + 0.1e-6 * t
    logs = [log_of(u, GAIN * u + drift) for u in total]
    found = pt.frequency_response(logs)
    assert np.abs(found.value / GAIN - 1.0).max() < 2e-4
    raw = np.fft.rfft(drift[: signals.shape[1]])[LINES.numbers(RATE)]
    assert np.abs(raw / np.fft.rfft(signals[0])[LINES.numbers(RATE)]).max() > 50e-4 * GAIN


def test_a_loop_excited_by_a_reference_shows_the_plant_not_the_controller() -> None:
    # Noise that the loop feeds back makes Y/U a mixture of plant and -1/controller.
    random = np.random.default_rng(2)
    plant, controller = 0.5, 4.0
    shape = (40, 4, 120)
    phases = random.uniform(0.0, 2.0 * np.pi, (40, 1, 120))
    reference = np.exp(1j * np.tile(phases, (1, 4, 1)))
    noise = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    error = (reference - noise) / (1.0 + plant * controller)
    drive = controller * error
    output = plant * drive + noise
    found = approximate(output, drive, reference[:, 0])
    naive = np.mean(output * drive.conj()) / np.mean(np.square(np.abs(drive)))
    assert abs(found.value.mean() - plant) < 0.03
    assert naive.real < plant - 0.2
    half = 0.5 * found.degrees
    band = np.sqrt(found.variance * half * (0.05 ** (-1.0 / half) - 1.0))
    assert 0.9 <= np.mean(np.abs(found.value - plant) <= band) <= 0.99


def test_a_chirp_gives_the_response_with_coherence() -> None:
    stage = pt.VirtualStage.of(LINEAR, mode=(MODE, 0.1), noise=20e-9)
    device = pt.hardware.VirtualDevice(stage, limits=(0.0, 75.0))
    log = pt.measure(device, "chirp:20..600Hz,28..32V,20s", rate=RATE)
    found = pt.frequency_response(log, resolution=4.0).within(40.0, 300.0)
    assert found.coherence is not None
    assert found.distortion is None
    w = 2.0 * np.pi * MODE
    system = ([GAIN * w * w], [1.0, 0.2 * w, w * w])
    numerator, denominator, _ = cont2discrete(system, 1.0 / RATE, method="zoh")
    _, truth = freqz(np.squeeze(numerator), denominator, worN=2 * np.pi * found.frequency / RATE)
    assert np.abs(found.value / truth - 1.0).max() < 0.05
    assert found.coherence.min() > 0.9
    noisy = pt.measure(
        pt.hardware.VirtualDevice(
            replace(stage, sensor=replace(stage.sensor, noise=3e-6)), limits=(0.0, 75.0)
        ),
        "chirp:20..600Hz,28..32V,20s",
        rate=RATE,
    )
    worse = pt.frequency_response(noisy, resolution=4.0).within(40.0, 300.0)
    assert worse.coherence is not None
    assert np.median(worse.coherence) < 0.9
    inside = np.abs(worse.value - truth) <= worse.band()
    assert 0.88 <= inside.mean() <= 1.0


def test_a_drive_that_begins_with_a_ramp_repeats_after_it() -> None:
    device = pt.hardware.VirtualDevice(modal(noise=1e-9), limits=(0.0, 75.0))
    log = pt.measure(device, "multisine:5/15/35/95Hz,28..32V,2s", rate=RATE)
    found = pt.frequency_response(log)
    assert found.frequency == pytest.approx([5.0, 15.0, 35.0, 95.0])
    assert found.value == pytest.approx(true_response(found.frequency), rel=2e-3)


def test_hysteresis_makes_the_gain_depend_on_the_amplitude() -> None:
    def gain(size: float) -> float:
        lines = replace(LINES, band=(8.0, 80.0), low=30.0 - size, high=30.0 + size)
        return float(np.mean(pt.frequency_response(PLAYS, lines, rate=RATE).magnitude))

    # From the gain after a reversal to that of all plays.
    gains = [gain(size) for size in (0.2, 2.0, 30.0)]
    assert gains[0] == pytest.approx(1.0e-6, rel=1e-3)
    assert gains[0] < gains[1] < gains[2] < 1.8e-6


def test_it_is_frequency_response_data_of_python_control() -> None:
    control = pytest.importorskip("control")
    found = pt.frequency_response(modal(noise=1e-9), LINES, rate=RATE)
    data = found.to_control()
    assert isinstance(data, control.FrequencyResponseData)
    plant = pt.to_control(modal(), limits=(0.0, 75.0), dt=1.0 / RATE)
    w = 2.0 * np.pi * found.frequency
    assert np.abs(data(1j * w) - found.value).max() == 0.0
    at_lines = plant(np.exp(1j * w / RATE))
    assert np.abs(found.value - at_lines).max() < 0.02 * found.magnitude.max()


def test_a_file_has_every_bit_and_others_are_refused(tmp_path: Path) -> None:
    found = pt.frequency_response(modal(noise=1e-9), LINES, rate=RATE)
    paths = found.save(tmp_path)
    again = pt.load_response(tmp_path / "response.json")
    assert {path.name for path in paths} >= {"response.csv", "response.json", "response.png"}
    for name in ("frequency", "value", "variance", "noise", "distortion"):
        assert (getattr(again, name) == getattr(found, name)).all(), name
    assert str(again) == str(found)
    document = json.loads((tmp_path / "response.json").read_text())
    for changed in (
        {"format": "piezotrack-model"},
        {"schema_version": 2},
        {"real": [1.0]},
        {"frequency_Hz": document["frequency_Hz"][::-1]},
        {"variance": "many"},
        {"dt_s": -1.0},
    ):
        wrong = tmp_path / "wrong.json"
        wrong.write_text(json.dumps({**document, **changed}))
        with pytest.raises(pt.PiezotrackError, match=r"wrong\.json"):
            pt.load_response(wrong)
    del document["variance"]
    wrong.write_text(json.dumps(document))
    with pytest.raises(pt.DataError, match="variance"):
        pt.load_response(wrong)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"band": (8.0, 1000.0)}, "half the sampling rate"),
        ({"band": (800.0, 8.0)}, "band"),
        ({"band": (9.0, 9.5), "resolution": 4.0}, "band"),
        ({"resolution": 9.0}, "resolution"),
        ({"low": 33.0}, "low"),
        ({"periods": 1, "realisations": 1}, "periods"),
        ({"periods": 0}, "periods"),
        ({"shape": [(10.0, 0.0)]}, "shape"),
        ({"high": 80.0}, "limits"),
        ({"lines": "even"}, "lines"),
        ({"resolution": 1e-5}, "samples in all"),
        ({"realisations": 10_000, "periods": 10_000}, "samples in all"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_the_output_moves(
    changed: dict[str, Any], named: str
) -> None:
    device = pt.hardware.VirtualDevice(modal(), limits=(0.0, 75.0))
    with pytest.raises(pt.ParameterError, match=named):
        pt.frequency_response(device, replace(LINES, **changed), rate=RATE)
    assert device.held == 0.0


def test_logs_that_give_no_response_are_refused() -> None:
    u = np.tile(LINES.signals(RATE)[0], 3)
    log = log_of(u, 1e-6 * u)
    with pytest.raises(pt.ParameterError, match="period"):
        pt.frequency_response(log, period=2.0)
    with pytest.raises(pt.ParameterError, match="rate"):
        pt.frequency_response(log, rate=RATE)
    with pytest.raises(pt.ParameterError, match="log 1"):
        pt.frequency_response([log, log_of(u, 1e-6 * u, rate=500.0)])
    with pytest.raises(pt.ParameterError, match="empty"):
        pt.frequency_response([])
    with pytest.raises(pt.ParameterError, match="rate"):
        pt.frequency_response(LINEAR, LINES)
    still = log_of(np.full(1000, 5.0), np.linspace(0.0, 1e-6, 1000))
    with pytest.raises(pt.DataError, match="drive does not move"):
        pt.frequency_response(still)
    for drive in (u, np.random.default_rng(1).standard_normal(1000)):
        with pytest.raises(pt.DataError, match="displacement does not move"):
            pt.frequency_response(log_of(drive, np.full(drive.size, 1e-6)))


def test_one_realisation_or_one_period_says_what_it_cannot_tell() -> None:
    one = pt.frequency_response(modal(noise=1e-9), replace(LINES, realisations=1), rate=RATE)
    assert one.distortion is None
    assert one.noise is not None
    assert any("one realisation" in note for note in one.notes)
    single = pt.frequency_response(modal(noise=1e-9), replace(LINES, periods=1), rate=RATE)
    assert single.noise is None
    assert any("one period" in note for note in single.notes)
    # A single period of a log repeats nothing.
    u = LINES.signals(RATE)[0]
    with pytest.raises(pt.ParameterError, match="half the log"):
        pt.frequency_response(log_of(u, 1e-6 * u), period=u.size / RATE)


def test_the_shape_and_the_range_are_kept() -> None:
    shaped = replace(LINES, shape=[(8.0, 1.0), (800.0, 0.1)], lines="all")
    signals = shaped.signals(RATE)
    sizes = np.abs(np.fft.rfft(signals, axis=1))[:, shaped.numbers(RATE)]
    frequency = shaped.numbers(RATE) * RATE / shaped.samples(RATE)
    assert sizes[0] == pytest.approx(sizes[3])
    assert sizes[0] / sizes[0, 0] == pytest.approx((frequency / 8.0) ** -0.5)
    assert (signals.min(), signals.max()) == pytest.approx((28.0, 32.0), abs=0.5)
    assert signals.min() >= 28.0
    assert signals.max() <= 32.0


def test_a_failure_leaves_the_output_at_rest() -> None:
    class Failing(pt.hardware.VirtualDevice):
        plays = 0

        def play(self, *given: Any, **others: Any) -> Any:
            self.plays += 1
            if self.plays == 3:
                raise pt.DeviceError("the link is gone")
            return super().play(*given, **others)

    device = Failing(modal(), limits=(0.0, 75.0))
    with pytest.raises(pt.DeviceError, match="link"):
        pt.frequency_response(device, LINES, rate=RATE)
    assert device.held == 0.0
