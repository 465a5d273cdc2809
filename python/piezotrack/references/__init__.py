"""What a stage is to follow.

Motions and waveforms of one axis, paths of two, references read from files, and the text form of
both that the command line takes.
"""
