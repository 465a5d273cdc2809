"""Stage models.

One file a model, their base classes and registry, their inverse for feedforward, the virtual
stage to experiment on, and the stage of two axes.
"""
