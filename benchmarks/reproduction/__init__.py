"""The source paper's figures redrawn and its numbers checked."""
