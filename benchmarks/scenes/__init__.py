"""Measure the savings of each thing left out of a scene; about a minute.

These are operations of the traced program, trace and compile time, and the time of a run: one turn
of the quiet motion at 30 rad/s, 0.06 mm.
"""
