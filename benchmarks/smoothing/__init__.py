"""Errors of the smoothed laws over their widths."""
