"""A stage of each model."""

from __future__ import annotations

from dataclasses import replace

import piezotrack as pt

STAGES: dict[str, pt.stages.Stage] = {
    "dahl": replace(pt.DahlStage.xu_li_2010(), b0=40.0),
    "bouc-wen": pt.BoucWenStage.xu_li_2010_corrected(),
    "first-order-dahl": pt.FirstOrderDahlStage(
        mass=0.1828,
        damping=100.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness=9e3,
        coulomb_force=0.15,
    ),
    "parallel-dahl": pt.ParallelDahlStage(
        mass=0.1828,
        damping=100.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness_1=4e3,
        rest_stiffness_2=3e3,
        rest_stiffness_3=2e3,
        yield_path=2e-6,
        path_ratio=4.0,
    ),
    "bouc-wen-oscillator": pt.BoucWenOscillator.benchmark(),
    "prandtl-ishlinskii": pt.PrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(10.0, 20.0),
        weights=(0.2e-6, 0.1e-6),
        creep_weights=(0.01,),
        creep_times=(0.1,),
        frequency=160.0,
        damping_ratio=0.5,
    ),
    "generalised-prandtl-ishlinskii": pt.GeneralisedPrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(10.0, 20.0),
        weights=(0.2e-6, 0.1e-6),
        scale=100.0,
        slope=0.01,
        shift=0.2,
        level=-10.0,
        time_constant=0.002,
    ),
    "polynomial-prandtl-ishlinskii": pt.PolynomialPrandtlIshlinskiiStage(
        a1=1e-6,
        a2=2e-9,
        a3=-1e-11,
        low=-20.0,
        high=75.0,
        thresholds=(10.0, 20.0),
        weights=(0.2e-6, 0.1e-6),
        creep_weights=(0.01,),
        creep_times=(0.1,),
    ),
    "preisach": pt.PreisachStage(
        linear=0.8e-6,
        levels=(-40.0, -10.0, 0.0, 20.0, 80.0),
        masses=(3e-6, 1e-6, 2e-6, 2e-6, 0.0, 4e-6, 3e-6, 1e-6, 5e-6, 9e-6),
        frequency=160.0,
        damping_ratio=0.5,
    ),
    "duhem": pt.DuhemStage(
        alpha=0.05,
        f1=1e-6,
        f2=1e-9,
        f3=0.0,
        g0=0.7e-6,
        g1=1e-9,
        g2=0.0,
        low=-20.0,
        high=75.0,
        time_constant=0.002,
    ),
}
