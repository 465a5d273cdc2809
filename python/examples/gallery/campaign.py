"""
Many records: a campaign
========================

Three parts of a log, two models each: do the parts differ, and do the models?
"""

import tempfile

import piezotrack as pt

log = pt.datasets.dbo_training()
records = {f"{begin} to {begin + 4} s": log.cut(begin, begin + 4) for begin in (3, 8, 13)}
models = ["prandtl-ishlinskii", "duhem"]
found = pt.campaign(records, models, folder=tempfile.mkdtemp())
for one in found:
    print(f"{one.record}, {one.model}: {one.rms_percent:.2f} %")

# %%
# One line for each record, one colour for each model.

found.plot()
