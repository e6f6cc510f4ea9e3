"""The steady-state RMS: solved for, and waited for by other programs."""
