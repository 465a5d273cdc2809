"""Controllers and their simulation.

Controller and components, stability of the loop, tracking with one axis and contouring with two;
pictures stand beside their results.
"""
