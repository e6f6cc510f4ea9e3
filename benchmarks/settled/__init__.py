"""The settled motion over the paper's box, and the resonances that fold it."""
