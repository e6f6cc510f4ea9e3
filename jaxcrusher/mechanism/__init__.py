"""Planar mechanisms whose revolute joints may have clearance, and their equations."""
