"""The settled RMS: solved for, and waited for by other programs."""
