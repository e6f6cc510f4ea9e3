"""The jaw crusher: its bodies, what drives and loads it, its equations of motion."""
