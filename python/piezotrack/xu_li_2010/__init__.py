"""The paper of Xu and Li 2010, doi 10.1115/1.4001712.

Its procedure, figures and tables on a virtual stage, published beside obtained; the calibration
of that stage; and the demonstration.
"""
