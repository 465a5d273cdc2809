"""A stage of each model."""

from __future__ import annotations

from dataclasses import replace

import piezotrack as pt

STAGES: dict[str, pt.stages.Stage] = {
    "dahl": replace(pt.DahlStage.xu_li_2010(), b0=40.0),
    "bouc-wen": pt.BoucWenStage.xu_li_2010_corrected(),
    "asymmetric-bouc-wen": pt.AsymmetricBoucWenStage(
        mass=0.1283,
        damping=1580.0,
        stiffness=19567.0,
        piezo_coefficient=1.7339e-6,
        alpha=0.3575,
        beta=0.0364,
        gamma=0.0272,
        asymmetry=-0.005,
        sign_asymmetry=-0.01,
    ),
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
    "lugre": pt.LuGreStage(
        mass=0.1828,
        damping=100.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness=9e3,
        micro_damping=20.0,
        coulomb_force=0.1,
        static_ratio=1.5,
        stribeck_velocity=1e-3,
        viscous_friction=5.0,
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
    "maxwell-slip": pt.MaxwellSlipStage(
        piezo_coefficient=1.3e-6,
        stiffness_ratios=(0.2, 0.1),
        slip_displacements=(10e-6, 22e-6),
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
}
