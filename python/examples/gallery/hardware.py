"""
Record, identify and learn on a controller
==========================================

A virtual controller that speaks GCS, the protocol of Physik Instrumente, over TCP. For one in the
lab put its address, ``gcs://192.168.0.10``, in place of ``server.address``. ``speed`` lets the time
of the virtual one go faster.
"""

import piezotrack as pt

server = pt.hardware.GcsServer(pt.VirtualStage.xu_li_2010(seed=1), speed=100.0)
device = pt.hardware.connect(server.address)

# %%
# Record a log, under a drive that shrinks from turn to turn: it has loops of every size in it.

log = pt.measure(device, "decaying:1Hz,0..75V", rate=1000.0)
fit = pt.identify(log, "prandtl-ishlinskii")
loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=fit.inverse())

# %%
# Learn the line of a raster, in six trials. A slow drive shows nothing of the mode at 160 Hz: the
# first trials excite it, and the cutoff of the learning falls below it.

line = pt.triangle(frequency=2.0, low=20e-6, high=80e-6, duration=2.0, rounding=0.2)
learnt = pt.learn(device, line, loop, trials=6)
print(learnt.summary())
learnt.plot()

# %%
# The output is at rest, and the connection closes.

device.close()
server.close()
