"""Solve 61 x 46 designs for both readings of slip, and follow a branch; about three minutes."""
