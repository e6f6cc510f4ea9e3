"""Names of the crusher's joints, and of what belongs to one."""

# The joints and their letters: the main bearing A (bore in the jaw, pin of the shaft), the elbow B
# (bore in the jaw, pin of the toggle), the pivot C (bore in the frame, pin of the toggle), and the
# shaft's own bearing O (bore in the frame).
LETTERS = {"main": "A", "elbow": "B", "pivot": "C", "shaft_bearing": "O"}
JOINTS = tuple(LETTERS)
