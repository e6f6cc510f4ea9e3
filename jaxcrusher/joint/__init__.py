"""A planar revolute joint with clearance: its laws, its contact, and where they hold."""
